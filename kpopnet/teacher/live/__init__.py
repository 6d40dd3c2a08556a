"""A lesson as it goes: camera, pose, score and words in a process of its own, and the verdict afterwards."""
