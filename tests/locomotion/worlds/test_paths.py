import numpy as np
import pytest
from numba import njit

from dynresp.locomotion.worlds.path_kernel import nearest_on
from dynresp.locomotion.worlds.paths import (
    as_path,
    as_point,
    check_length,
    distances_to,
    resampled,
    window_m,
)
from dynresp.support.errors import UsageError

_nearest_on = njit(lambda path, x, y, done, window: nearest_on(path, x, y, done, window))


def test_distances_to_a_path() -> None:
    path = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)])
    points = np.array([(-1.0, 0.0), (1.0, 0.5), (2.5, 1.0), (1.0, 3.0)])
    np.testing.assert_allclose(distances_to(path, points), [1.0, 0.5, 0.5, np.sqrt(2.0)])


@pytest.mark.parametrize("wrong", ["abc", None, 3.0, [[1.0, 2.0, 3.0]], [[1.0, 2.0], [3.0]], []])
def test_wrong_paths_are_refused(wrong: object) -> None:
    with pytest.raises(UsageError, match=r"a sketch must be points \(k, 2\), got"):
        as_path(wrong, "a sketch")  # type: ignore[arg-type]


def test_a_path_is_finite_and_not_too_long() -> None:
    with pytest.raises(UsageError, match="finite points"):
        as_path([(0.0, 0.0), (np.inf, 0.0)])
    check_length(as_path([(0, 0), (1000, 0)]), "it")
    with pytest.raises(UsageError, match="it is 1200 m long; at most 1000 m"):
        check_length(as_path([(0, 0), (600, 0), (0, 0)]), "it")


@pytest.mark.parametrize("wrong", ["abc", None, 3.0, (1.0,), (1.0, np.nan), [(1.0, 2.0)], {}])
def test_wrong_points_are_refused(wrong: object) -> None:
    with pytest.raises(UsageError, match=r"a goal must be two finite numbers, x and y \[m\], got"):
        as_point(wrong, "a goal")  # type: ignore[arg-type]


def test_progress_never_decreases() -> None:
    path = resampled([(0.0, 0.0), (2.0, 0.0), (0.0, 0.0), (2.0, 0.0)], 0.1)
    done, progress = 0.0, []
    for x in [*np.arange(0.0, 2.0, 0.07), *np.arange(2.0, 0.0, -0.07), *np.arange(0.0, 2.0, 0.07)]:
        done, away = _nearest_on(path, x, 0.0, done, 4)
        assert away < 0.07
        progress.append(done)
    assert (np.diff(progress) >= 0.0).all()
    assert progress[-1] == pytest.approx(59.5, abs=0.6)
    # Standing still and going back keep the progress; going back adds distance.
    assert _nearest_on(path, 1.0, 0.0, 10.0, 4) == (10.0, 0.0)
    assert _nearest_on(path, 0.5, 0.0, 10.0, 4) == pytest.approx((10.0, 0.5))


def test_the_nearest_point_is_searched_ahead(rng: np.random.Generator) -> None:
    path = np.cumsum(rng.normal(0.0, 0.1, (30, 2)), axis=0)
    for _ in range(200):
        point, done = rng.normal(0.0, 0.4, 2), rng.uniform(0.0, 29.0)
        found, away = _nearest_on(path, *point, done, 4)
        at = np.linspace(done, min(int(done) + 4, 29), 2001)
        places = np.stack([np.interp(at, np.arange(30), path[:, k]) for k in range(2)], axis=1)
        assert done <= found <= at[-1] + 1e-9
        assert away == pytest.approx(np.hypot(*(places - point).T).min(), abs=1e-3)


def test_a_path_of_one_point_and_one_of_equal_points() -> None:
    assert _nearest_on(np.array([(1.0, 1.0)]), 1.0, 3.0, 0.0, 4) == (0.0, 2.0)
    assert _nearest_on(np.array([(1.0, 1.0), (1.0, 1.0)]), 1.0, 3.0, 0.0, 4) == (1.0, 2.0)


def test_at_low_rates_the_window_is_longer() -> None:
    assert window_m(15.0) == pytest.approx(0.4)
    assert window_m(60.0) == pytest.approx(0.4)
    assert window_m(5.0) == pytest.approx(1.2)
