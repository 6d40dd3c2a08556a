"""Human extraction (section 2.1, Algorithm 1): the people in the pictures of a depth camera that stands still.

    picture -> the floor removed -> objects (3D connected components) -> the moving ones are human -> who is who

`HumanExtractor` takes picture after picture, `extract_person` a whole recording of one person. What the paper leaves open
or gets wrong is settled in the modules: `floor` (the plane), `room` (what has moved), `components` (what belongs
together), `people` and `silhouettes` (who is who), `standing` (somebody who has not moved yet).
"""

from kpopnet.extraction.humans import Human, HumanExtractionConfig, HumanExtractor
from kpopnet.extraction.recording import extract_person

__all__ = ["Human", "HumanExtractionConfig", "HumanExtractor", "extract_person"]
