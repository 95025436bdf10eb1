import numpy as np
import pytest

from pcsr import UserError
from pcsr.recorded.likely_mistakes import check_coverage, check_indentation, check_sign
from tests.recorded.pressed import pressed


@pytest.mark.parametrize("bulge", [0.0, 0.03, 0.1])
@pytest.mark.parametrize("press", [0.15, 0.4, 0.84])
def test_presses_of_any_depth_have_the_right_sign_and_their_negatives_the_wrong_one(press, bulge):
    indentation, _ = pressed(press, bulge=min(bulge, press / 4))
    check_sign(indentation)
    with pytest.raises(UserError, match="mm the other way: give the other sign"):
        check_sign(-indentation)


def test_what_is_not_far_deeper_the_other_way_or_hardly_noticed_is_no_mistake():
    v = np.linspace(-1, 1, 40)[:, None] * np.ones(30)
    check_sign(v)
    check_sign(v + 0.3 - 0.6)
    with pytest.raises(UserError):
        check_sign(v - 0.5)
    check_sign(np.full((5, 5), -0.04))
    check_sign(np.full((5, 5), np.nan))


def test_a_few_wrong_pixels_and_those_that_do_not_count_tell_nothing():
    indentation, _ = pressed()
    indentation[10:12, 20:22] = -9
    check_sign(indentation)
    indentation[10:13, 20:23] = -9
    with pytest.raises(UserError, match="9 mm the other way"):
        check_sign(indentation)
    indentation[10:13, 20:23] = np.nan
    check_sign(indentation)


@pytest.mark.parametrize(
    ("sensor", "most"), [("digit", 5.0), ("DIGIT 2", 5.0), ("gelsight-mini", 5.0), ("", 30.0), ("x", 30.0)]
)
def test_a_gel_is_indented_no_deeper_than_it_is_thick(sensor, most):
    check_indentation(most, sensor, "correct unit")
    with pytest.raises(UserError, match=rf"more than the {most:g} mm that .* is thick: correct unit$"):
        check_indentation(most + 0.01, sensor, "correct unit")


def test_pixels_without_contact_show_the_untouched_gel():
    contact = np.zeros((10, 10), bool)
    contact[:9] = True
    check_coverage(contact)
    contact[9, 0] = True
    with pytest.raises(UserError, match="91% of the pixels are in contact"):
        check_coverage(contact)
