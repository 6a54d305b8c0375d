"""The data of a call goes one way through the rooms, but for what the integrator evaluates."""

from support.call_route import routes


def test_the_routes_of_reconstruct_and_split_stay_short():
    """Of the flat library `split` had 65 stops and 26 climbs, which is more than halved.

    `reconstruct` had 10 and 3: since then it asks first whether machine code knows the body, and remembers samples for
    other momenta, both between the rooms of shapes and steps.
    """
    found = routes()
    assert len(found["split"].rooms) <= 32
    assert found["split"].climbs <= 13
    assert len(found["reconstruct"].rooms) <= 20
    assert found["reconstruct"].climbs <= 6
