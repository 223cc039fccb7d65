"""The scenes that ship with collide. `collide.scenes.path(name)` gives a file to copy and change."""
