"""Clients are private, quiet, and close once."""

import subprocess
import sys
from pathlib import Path

import pytest

from fieldgym.simulation.client import PhysicsClient, pybullet

pytestmark = pytest.mark.portable

PACKAGE_PARENT = Path(sys.modules["fieldgym"].__file__ or "").absolute().parent.parent


def test_clients_do_not_see_each_other() -> None:
    with PhysicsClient() as first, PhysicsClient() as second:
        pybullet.createMultiBody(1.0, physicsClientId=first.id)
        assert pybullet.getNumBodies(physicsClientId=first.id) == 1
        assert pybullet.getNumBodies(physicsClientId=second.id) == 0


def test_a_step_lasts_what_the_rate_says_under_gravity() -> None:
    with PhysicsClient(200.0, gravity_m_s2=10.0) as client:
        body = pybullet.createMultiBody(1.0, physicsClientId=client.id)
        pybullet.changeDynamics(body, -1, linearDamping=0.0, physicsClientId=client.id)
        client.step()
        velocity, _ = pybullet.getBaseVelocity(body, physicsClientId=client.id)
    assert velocity[2] == pytest.approx(-10.0 / 200.0)


def test_close_can_be_called_again_and_spares_others() -> None:
    other = PhysicsClient()
    client = PhysicsClient()
    assert not client.closed
    client.close()
    client.close()
    assert client.closed
    assert pybullet.isConnected(physicsClientId=other.id)
    other.close()


def test_a_number_given_back_is_not_closed_by_its_former_owner() -> None:
    first = PhysicsClient()
    first.close()
    second = PhysicsClient()
    first.close()
    del first
    assert pybullet.isConnected(physicsClientId=second.id)
    second.close()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"physics_hz": 0.0}, "physics_hz"),
        ({"physics_hz": float("nan")}, "physics_hz"),
        ({"solver_iterations": 0}, "solver_iterations"),
        ({"erp": 1.5}, "erp"),
    ],
)
def test_bad_settings_are_named(arguments: dict, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        PhysicsClient(**arguments)


def test_loading_and_connecting_print_nothing() -> None:
    code = (
        "import sys; from fieldgym.simulation.picker import PickerMachine; PickerMachine().close();"
        "sys.stderr.write('still here')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE_PARENT, check=True)
    assert (done.stdout, done.stderr) == ("", "still here")
