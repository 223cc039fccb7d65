"""A World, the report of a scene, or a planned trajectory in the viewers that teams run: viser, rerun and Foxglove.

`viewed.py` says what is shown, once for all; a file a viewer hands it over: `to_viser`, `to_rerun`, `to_foxglove`.
"""
