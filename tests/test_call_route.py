"""The data of a call goes one way through the rooms, but for what the integrator evaluates."""

from support.call_route import routes


def test_the_routes_of_reconstruct_and_split_stay_short():
    """Of the flat library `split` had 65 stops and 26 climbs, which is more than halved.

    `reconstruct` had 10 and 3: since then samples are remembered for other momenta, between the rooms of shapes and
    steps, and bodies may come as a family. Every number of a split has its own error estimate since, and what closes
    the momentum's curve is found with it; and both say what a wrong object is. What `reconstruct` gives is compared
    with the body at times that no rule has seen: twelve stops and four climbs. `split` asks twice whether the body
    has wheels of a stated speed, and once whether its curve has: five stops and two climbs. Loops are sampled in rounds
    like all else, each of which asks the body: nineteen stops and four climbs; and a split steps its own lift, and
    pieces of its curve, by functions of the integrator: six stops and three climbs.
    """
    found = routes()
    assert len(found["split"].rooms) <= 48
    assert found["split"].climbs <= 23
    assert len(found["reconstruct"].rooms) <= 49
    assert found["reconstruct"].climbs <= 14
