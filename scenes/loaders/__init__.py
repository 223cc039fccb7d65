"""One file per format; `dispatch` recognises them. Formats share `files` (opening what a user names, and every limit),
`documents` (YAML and JSON text), `fields` (checked reading of mappings), `resources` (where a file name points), `mesh`
and `triangles` (mesh files, each format in a file of its own: `stl`, `obj`, `ply`, `off`, `dae`, `gltf`)."""
