"""Kernels of the curvature: products with the rows of the Jacobian of ln mu, bin by bin.

``entries`` are the arrays of a `frontend.reconstruction.forward.Curvature` in order; ``sonar`` is the tail of a flat
direction: beam pattern of port and starboard at its knots, then the gain of each line's sides.
"""

import numba


@numba.njit(cache=True, nogil=True)
def _multiply_bins(entries, weight, direction, back, to_sonar):  # type: ignore[no-untyped-def]
    """Push a direction through the Jacobian, weigh it, and pull it back."""
    cell, by_height, by_reflectivity, n_cells, shares, knots = entries
    rasters, sonar = direction
    height, reflectivity = rasters[0], rasters[1]
    gains = sonar.size - 2 * cell.shape[0]
    n_knots = gains // 2
    for ping in range(cell.shape[0]):
        for side in range(2):
            own = gains + 2 * ping + side
            for b in range(cell.shape[2]):
                if weight[ping, side, b] == 0.0:
                    continue
                c, jz, jr = cell[ping, side, b], by_height[ping, side, b], by_reflectivity[ping, side, b]
                share, knot, count = shares[ping, side, b], knots[ping, side, b], n_cells[ping, side, b]
                k = min(int(knot), n_knots - 2)
                f, near = knot - k, side * n_knots + k
                value = share * (sonar[own] + (1 - f) * sonar[near] + f * sonar[near + 1])
                for i in range(count):
                    value += jz[i] * height[c[i]] + jr[i] * reflectivity[c[i]]
                value *= weight[ping, side, b]
                for i in range(count):
                    back[0, c[i]] += jz[i] * value
                    back[1, c[i]] += jr[i] * value
                to_sonar[near] += (1 - f) * share * value
                to_sonar[near + 1] += f * share * value
                to_sonar[own] += share * value


@numba.njit(cache=True, nogil=True)
def _multiply_places(below, height, back):  # type: ignore[no-untyped-def]
    """The same for the heights measured below the track."""
    first, cells, weights, precision = below
    for place in range(precision.size):
        value = 0.0
        for i in range(first[place], first[place + 1]):
            value += weights[i] * height[cells[i]]
        for i in range(first[place], first[place + 1]):
            back[cells[i]] += weights[i] * precision[place] * value


@numba.njit(cache=True, nogil=True)
def _pull(entries, values, out, beam, gain):  # type: ignore[no-untyped-def]
    """The transpose of the Jacobian."""
    cell, by_height, by_reflectivity, n_cells, shares, knots = entries
    for ping in range(cell.shape[0]):
        for side in range(2):
            for b in range(cell.shape[2]):
                value = values[ping, side, b]
                if value == 0.0:
                    continue
                c, jz, jr = cell[ping, side, b], by_height[ping, side, b], by_reflectivity[ping, side, b]
                for i in range(n_cells[ping, side, b]):
                    out[0, c[i]] += jz[i] * value
                    out[1, c[i]] += jr[i] * value
                knot, sonar = knots[ping, side, b], shares[ping, side, b] * value
                k = min(int(knot), beam.shape[1] - 2)
                beam[side, k] += (k + 1 - knot) * sonar
                beam[side, k + 1] += (knot - k) * sonar
                gain[ping, side] += sonar


@numba.njit(cache=True, nogil=True)
def _square(entries, weight, cells, levels):  # type: ignore[no-untyped-def]
    """Weighted sums of squared derivatives by the height of each cell, and by all heights or reflectivities at once."""
    cell, by_height, by_reflectivity, n_cells, _, _ = entries
    for ping in range(weight.shape[0]):
        for side in range(2):
            for b in range(weight.shape[2]):
                w, height, reflectivity = weight[ping, side, b], 0.0, 0.0
                for i in range(n_cells[ping, side, b]):
                    slope = by_height[ping, side, b, i]
                    cells[cell[ping, side, b, i]] += w * slope**2
                    height += slope
                    reflectivity += by_reflectivity[ping, side, b, i]
                levels[0] += w * height**2
                levels[1] += w * reflectivity**2
