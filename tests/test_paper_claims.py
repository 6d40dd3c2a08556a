"""The films of the paper's claims are of other people than a benchmark's."""

from programs import tool

from synth.simulated.stand_ins import EvalSim, EvalSimConfig

claims = tool("paper_claims")


def test_films_have_the_motions_of_eval_sim_by_people_of_the_training_split() -> None:
    config, frames = EvalSimConfig(seed=5, sequences=1), (30, 30)
    ours, theirs = (of(config, frames=frames) for of in (claims.TrainEvalSim, EvalSim))
    assert len(ours.take(0)) == 30 and ours.person(0) != theirs.person(0) and ours.person(0, 1) != ours.person(0)
