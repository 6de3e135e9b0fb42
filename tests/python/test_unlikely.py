"""Remarks on what is possible but unlikely; none on drawings of any size that are as they should be."""

import pytest

import partita as pt


def linkage(size: float = 1.0, mass: float = 1.0, pin: tuple[float, float, float] | None = None) -> pt.Mechanism:
    """A double pendulum of rods; `pin` is where the second hinge is said to be."""
    m = pt.Mechanism("double pendulum")
    a = m.add_rod("a", (0, 0, 0), (0.5 * size, 0, 0), mass)
    b = m.add_rod("b", (0.5 * size, 0, 0), (size, 0, 0), mass)
    m.add_revolute("A", m.ground, a, (0, 0, 0))
    m.add_revolute("B", a, b, pin or (0.5 * size, 0, 0))
    return m


def ball(height: float, radius: float, normal: tuple[float, float, float] = (0, 1, 0)) -> pt.Mechanism:
    m = pt.Mechanism("ball")
    one = m.add_body("ball", mass=0.1, inertia=(1e-5,) * 3, position=(0, height, 0))
    m.add_free("F", m.ground, one)
    m.add_contact("C", one, (0, 0, 0), m.ground, (0, 0, 0), radius1=radius, normal=normal, stiffness=1e5)
    return m


def test_a_contact_that_begins_deep() -> None:
    (remark,) = ball(-0.18, 0.01).check()
    assert remark == (
        'contact "C" begins 0.19 m deep and is pushed out with 8.28e+03 N, where its radius is 0.01 m; draw the body '
        "outside, or turn the normal towards the free side"
    )
    assert remark in ball(-0.18, 0.01).simulate(1e-4).notes
    assert list(ball(0.0099, 0.01).check()) == [] == list(ball(0.5, 0.01).check())
    assert "begins 0.51 m deep" in str(ball(0.5, 0.01, normal=(0, -1, 0)).check())
    m = pt.Mechanism("two balls")
    for name, x in (("a", 0.0), ("b", 0.005)):
        body = m.add_body(name, mass=0.1, inertia=(1e-5,) * 3, position=(x, 0, 0))
        m.add_free(f"F{name}", m.ground, body)
    m.add_contact("C", "a", (0, 0, 0), "b", (0, 0, 0), radius1=0.02, radius2=0.01, stiffness=1e5)
    (remark,) = m.check()
    assert "begins 0.025 m deep" in remark and "its radius is 0.01 m" in remark


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e3])
def test_a_joint_far_off_its_body(unit: float) -> None:
    """By ratios: the same drawing in any unit."""
    mass = unit**3
    (remark,) = linkage(unit, mass, (50 * unit, 0, 0)).check()
    assert remark.startswith('joint "B": its point lies 4') and "where all else that is drawn measures" in remark
    assert list(linkage(unit, mass, (3 * unit, 0, 0)).check()) == [] == list(linkage(unit, mass).check())


def test_a_rod_of_metres_that_was_to_be_one_of_millimetres() -> None:
    m = pt.Mechanism("crank")
    rod = m.add_rod("rod", (0, 0, 0), (150, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, (0, 0, 0))
    (remark,) = m.check()
    assert remark == (
        'body "rod" is 150 m long and has 1 kg, less than a thin bar of air of that length (35.3 kg); lengths are '
        'metres: give "150 mm" if millimetres are meant'
    )
    for length, mass in (("150 mm", 1.0), (150.0, 5e4), (0.001, 1e-6), (1.0, 1e-3), (150.0, 0.0)):
        m = pt.Mechanism("crank")
        rod = m.add_rod("rod", (0, 0, 0), (length, 0, 0), mass=mass)
        tip = m.add_body("tip", mass=1.0, inertia=(1, 1, 1), position=(length, 0, 0))
        m.add_revolute("A", m.ground, rod, (0, 0, 0))
        m.add_fixed("B", rod, tip, (length, 0, 0))
        assert not [words for words in m.check() if "air" in words]


def test_a_start_far_from_the_drawing() -> None:
    def slide(position: float) -> pt.Mechanism:
        m = pt.Mechanism("slide")
        body = m.add_body("block", mass=1.0, inertia=(0.1, 0.1, 0.1))
        m.add_prismatic("S", m.ground, body, axis=(1, 0, 0))
        m.add_drive("S", position=position)
        return m

    (remark,) = slide(1.0).check()
    assert remark.startswith('the start is far from the drawing: "block" begins 1 m from where it is drawn')
    assert list(slide(0.1).check()) == []
    m = slide(1.0)
    assert list(m.check(m.assemble())) == []  # where to look was given


def test_a_wheel_that_begins_under_its_road() -> None:
    def wheel(height: float) -> pt.Mechanism:
        m = pt.Mechanism("wheel")
        body = m.add_body("wheel", mass=10.0, inertia=(0.3, 0.5, 0.3), position=(0, 0, height))
        m.add_free("F", m.ground, body)
        m.add_tyre("T", body, center=(0, 0, 0), axis=(0, 1, 0), radius=0.3, normal=(0, 0, 1), stiffness=2e5)
        return m

    (remark,) = wheel(-0.1).check()
    assert remark.startswith('tyre "T" begins 0.4 m deep, where its radius is 0.3 m')
    assert list(wheel(0.29).check()) == [] == list(wheel(2.0).check())


def test_numbers_without_measure_end_in_no_error_of_python() -> None:
    """A depth whose power no number holds."""
    m = pt.Mechanism("ball")
    one = m.add_body("ball", mass=0.1, inertia=(1e-5,) * 3, position=(0, -1e59, 0))
    m.add_free("F", m.ground, one)
    contact = {"radius1": 0.01, "normal": (0, 1, 0), "stiffness": 1e5, "exponent": 8.0}
    m.add_contact("C", one, (0, 0, 0), m.ground, (0, 0, 0), **contact)  # type: ignore[arg-type]
    assert any("pushed out with inf N" in words for words in m._remarks())
