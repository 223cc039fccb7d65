"""Triangle meshes in pair queries and worlds: solids and surfaces, against each other and against convex shapes."""
