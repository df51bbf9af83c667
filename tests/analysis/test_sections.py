"""Masses and moments of inertia of sections, held against numerical integration of density over the body."""

import numpy as np
import pytest

from analysis.sections import DENSITIES, Bar, Plate, Rod, Section, Tube, density
from linkwork.errors import ParameterError

LENGTH = 0.23


def _layers(section: Section) -> tuple[float, float, bool]:
    """Return the extents of a section in and normal to the plane, and whether it is round."""
    if isinstance(section, Bar):
        return section.width, section.thickness, False
    width = section.diameter if isinstance(section, Rod) else section.outer
    return width, width, True


@pytest.mark.parametrize("section", [Rod(0.02, "steel"), Tube(0.03, 0.022, "aluminium"), Bar(0.04, 0.006, 1240.0)])
def test_mass_and_inertia_are_the_integrals_over_the_body(section: Section) -> None:
    width, height, is_round = _layers(section)
    n = 1200
    y, z = ((np.arange(n) + 0.5) / n - 0.5) * width, ((np.arange(n) + 0.5) / n - 0.5) * height
    inside = np.ones((n, n))
    if is_round:
        radius = np.hypot(y[:, None], z[None, :])
        inside = (radius < 0.5 * width) & (radius > (0.5 * section.inner if isinstance(section, Tube) else -1.0))
    cell = section.density * width * height / n**2
    mass = LENGTH * cell * inside.sum()
    inertia = mass * LENGTH**2 / 12.0 + LENGTH * cell * (inside * y[:, None] ** 2).sum()
    assert section.mass(LENGTH) == pytest.approx(mass, rel=2e-4)
    about_middle = section.inertia(LENGTH) - section.mass(LENGTH) * LENGTH**2 / 12.0
    assert about_middle == pytest.approx(inertia - mass * LENGTH**2 / 12.0, rel=1e-3)


@pytest.mark.parametrize("sense", [1, -1])
def test_plate_is_the_integral_over_its_triangles(sense: int) -> None:
    """An L-shaped plate far from the origin, against a sum over the cells of a grid that its edges do not cut."""
    corners = np.array([[0, 0], [5, 0], [5, 2], [2, 2], [2, 6], [0, 6]]) * 0.01 + [3.0, -2.0]
    cells = (np.stack(np.meshgrid(np.arange(50), np.arange(60), indexing="ij"), -1).reshape(-1, 2) + 0.5) * 0.001
    cells = cells[(cells[:, 0] < 0.02) | (cells[:, 1] < 0.02)]
    weight = 0.004 * DENSITIES["steel"] * 1e-6
    centre = cells.mean(axis=0)
    own = (1e-3**2 + 1e-3**2) / 12.0  # of each cell about its own centre
    inertia = weight * (((cells - centre) ** 2).sum() + own * len(cells))
    found = Plate("4 mm", "steel").properties(corners[::sense])
    assert found.mass == pytest.approx(weight * len(cells), rel=1e-12)
    assert found.centre == pytest.approx((centre[0] + 3.0, centre[1] - 2.0), rel=1e-12)
    assert found.inertia == pytest.approx(inertia, rel=1e-9)


def test_a_rectangular_plate_is_a_bar() -> None:
    bar, plate = Bar("30 mm", "5 mm", "steel"), Plate("5 mm", "steel")
    found = plate.properties([[0, 0], [LENGTH, 0], [LENGTH, 0.03], [0, 0.03]])
    assert (found.mass, found.inertia) == pytest.approx((bar.mass(LENGTH), bar.inertia(LENGTH)), rel=1e-12)
    assert found.centre == pytest.approx((LENGTH / 2, 0.015), rel=1e-12)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Rod(0.0, "steel"), "diameter"),
        (lambda: Rod("2 kg", "steel"), "diameter"),
        (lambda: Rod(0.01, "stell"), "aluminium"),
        (lambda: Tube(0.01, 0.01, "steel"), "inner"),
        (lambda: Bar(0.01, 0.01, -1.0), "density"),
        (lambda: Bar(0.01, 0.01, "steel").mass(0.0), "length"),
        (lambda: Plate(0.01, "steel").properties([[0, 0], [1, 1]]), "three corners"),
        (lambda: Plate(0.01, "steel").properties([[0, 0], [1, 1], [2, 2]]), "line"),
        (lambda: Plate(0.01, "steel").properties([[0, 0], [3, 1], [3, 0], [0, 2]]), "cross"),
    ],
)
def test_what_is_no_section_is_refused(make: object, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        make()  # type: ignore[operator]


def test_densities_are_read_with_their_units() -> None:
    assert density("7.85 g/cm3") == pytest.approx(DENSITIES["steel"])
    with pytest.raises(ParameterError, match=r"material is \['steel'\]: it must be a number in kg/m3"):
        density(["steel"], "material")  # type: ignore[arg-type]
