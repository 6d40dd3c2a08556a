"""synth makes depth: posed bodies in rooms, rendered, spoilt by a depth camera and cut out, with their true joints.

It imports kpopnet's nouns (skeleton, camera, shards, ridge); kpopnet never imports synth.
"""
