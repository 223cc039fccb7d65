"""Two shapes and their poses: booleans and distances of pairs, in batches, in threads, with a margin."""
