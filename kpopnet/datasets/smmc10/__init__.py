"""SMMC-10: SwissRanger point clouds and markers in binary files."""
