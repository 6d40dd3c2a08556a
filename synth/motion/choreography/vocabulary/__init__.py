"""The vocabulary of dance moves: moves of the feet, of the arms, and of the whole body, as `moves.Move` values."""

from synth.motion.choreography.vocabulary.lower import LOWER
from synth.motion.choreography.vocabulary.upper import UPPER
from synth.motion.choreography.vocabulary.whole import WHOLE

__all__ = ["LOWER", "UPPER", "WHOLE"]
