"""Reports for people and scripts: what a World query found, sorted into classes, with its proofs.

Reads results only: `report` sorts them, `tables` lays them out, `terminal` prints them,
`schema.json` describes the JSON.
"""
