"""A lesson in a process of its own: camera, joints, score and messages."""
