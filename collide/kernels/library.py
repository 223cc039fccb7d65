def load():
    return "not built"
