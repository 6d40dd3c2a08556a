"""The minute that `kpopnet check` asks of a person before a camera, and that the films of `check_sim` show."""

from typing import NamedTuple


class Step(NamedTuple):
    """A part of the minute."""

    name: str  # of the step
    start_s: float  # its start, in seconds from that of the script
    told: str  # what the person is told to do


SCRIPT = (
    Step("empty room", 0.0, "stay where the camera does not see you"),
    Step("come in", 8.0, "come in, to about 2.5 m before the camera, and face it"),
    Step("stand still", 14.0, "stand still, your arms hanging"),
    Step("turn", 21.0, "turn once around"),
    Step("raise hands", 28.0, "raise both hands, and lower them"),
    Step("sit", 33.0, "sit down on the chair behind you"),
    Step("leave", 42.0, "stand up, and go where the camera does not see you"),
    Step("come back", 52.0, "come back, and face the camera"),
)
END_S = 60.0


def step_s(name: str) -> tuple[float, float]:
    """Start and end of a step, seconds."""
    starts = {step.name: step.start_s for step in SCRIPT}
    return starts[name], min([one for one in starts.values() if one > starts[name]], default=END_S)
