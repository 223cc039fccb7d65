"""One file per format; `dispatch` recognises them. Formats share `documents` (YAML and JSON text),
`fields` (checked reading of mappings), `resources` (where a file name points) and `mesh`."""
