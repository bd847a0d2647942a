"""Six presets without a body, those of `flown_bytes.PRESETS`, keep their bytes, whatever is done for bodies.

Where processor and versions are those of `flown_bytes.json`, every digest must be equal. Elsewhere the last
bits may differ (docs/reference/versions.md), and a turned cell of a map may lead to another site: there each
flight must end within a millimetre and a millisecond of where it did, but for as many as happen once in 10000
were one in ten to differ, each on its own.
"""

import json

import numpy as np
import pytest

from studies.statistics.ratios import least_passing
from tests.studies.flown_bytes import FLIGHTS, KEPT, flown_on, fly_episodes


@pytest.mark.slow
def test_flights_without_a_body_keep_their_bytes() -> None:
    kept = json.loads(KEPT.read_text())
    found = dict(pair for each in FLIGHTS for pair in fly_episodes(*each))
    assert found.keys() == kept["flights"].keys()
    moved = [name for name in found if found[name]["digest"] != kept["flights"][name]["digest"]]
    if kept["flown_on"] == flown_on():
        assert moved == [], f"of {len(found)} flights; meant? see tests/studies/flown_bytes.py"
    ends = [
        np.array([[*each[n]["touchdown"], each[n]["time"]] for n in found])
        for each in (found, kept["flights"])
    ]
    same = int((np.abs(ends[0] - ends[1]) < 1.1e-3).all(axis=1).sum())
    assert same >= least_passing(len(found), 0.9), (
        f"{same} of {len(found)} flights end where they did; {moved}"
    )
