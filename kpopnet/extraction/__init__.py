"""Human extraction beyond Algorithm 1: finds and tracks the people in the depth images of a static camera.

    image -> floor removal -> objects (3D connected components) -> moving objects are human -> identities

`HumanExtractor` processes one image per call. Each module states its assumptions where the paper is silent or wrong: `floor`
(the floor plane), `background` (which pixels have moved), `components` (which pixels form one object), `association` and
`assignment` (which person is which), `stationary` (a person who has not moved yet).
"""

from kpopnet.extraction.extractor import HumanExtractionConfig, HumanExtractor

__all__ = ["HumanExtractionConfig", "HumanExtractor"]
