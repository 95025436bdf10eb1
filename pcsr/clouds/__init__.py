"""Records of point clouds and touches, and their file formats."""
