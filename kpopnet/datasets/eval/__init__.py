"""EVAL: organised point clouds and joints in binary files."""
