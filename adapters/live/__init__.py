"""The page of a report while a World changes: served to browsers on this machine, and told what moved.

`world_viewer.view` follows a World, `scene_viewer` the files of a scene; `event_server` is what browsers talk to.
"""
