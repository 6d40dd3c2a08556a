"""What EVAL and SMMC-10 share: organised point clouds, the camera fitted to them, the map from ids to joints."""
