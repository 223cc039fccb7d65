"""Point clouds, cells of voxels and large terrain against other shapes."""
