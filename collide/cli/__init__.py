"""The command ``collide``: a file a command, and the files, numbers and scenes that commands share."""
