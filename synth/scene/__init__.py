"""The MuJoCo scene (person, room and camera) and the depth renderers."""
