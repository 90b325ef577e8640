"""Kernels of the forward model: the walk along one line of a ping, and what is gathered on the way.

A line is a row of 16 numbers: transducer (0-2), side axis (3-5), up axis (6-8), heading (9-10), the horizontal
direction of the walk (11-12), the tangent of the pitch, nose down (13), and how far the echo's place runs along with
the vehicle while sound is under way: by its speed [1] (14) and its turn [1/m] (15). ``grid`` is rows, columns, spacing
and origin; ``tables`` are beam pattern, range law and their first knots and steps.
"""

import numba
import numpy as np


@numba.njit(cache=True, inline="always")
def _lookup(table, position):  # type: ignore[no-untyped-def]
    """Value and slope (a knot) of a table at a fractional knot, held at the ends."""
    i = int(np.floor(position))
    if i < 0:
        return table[0], 0.0
    if i >= table.size - 1:
        return table[table.size - 1], 0.0
    slope = table[i + 1] - table[i]
    return table[i] + slope * (position - i), slope


@numba.njit(cache=True, inline="always")
def _along(line, u, height):  # type: ignore[no-untyped-def]
    """Distance along track of the place that is heard at across-track distance u."""
    return line[13] * (height - line[2]) + u * (line[14] + line[15] * u)


@numba.njit(cache=True, inline="always")
def _place(z, grid, line, u, height):  # type: ignore[no-untyped-def]
    """Walk to across-track distance u: cell, weights, height. The place along track follows the height (pitch)."""
    n_y, n_x, spacing, x0, y0 = grid
    for _ in range(2):
        v = _along(line, u, height)
        fx = (line[0] + line[11] * u + line[9] * v - x0) / spacing
        fy = (line[1] + line[12] * u + line[10] * v - y0) / spacing
        if not (fx >= 0.0 and fy >= 0.0 and fx < n_x - 1 and fy < n_y - 1):
            return -1, -1, 0.0, 0.0, height
        column, row = int(fx), int(fy)
        ax, ay = fx - column, fy - row
        height = (1 - ay) * ((1 - ax) * z[row, column] + ax * z[row, column + 1]) + ay * (
            (1 - ax) * z[row + 1, column] + ax * z[row + 1, column + 1]
        )
        if line[13] == 0.0:
            break
    return row, column, ax, ay, height


@numba.njit(cache=True, inline="always")
def _sample(z, rho, grid, line, at, tables, side):  # type: ignore[no-untyped-def]
    """Energy of a sample; range and its derivative; derivatives of ln energy by height and slopes; knot of the beam."""
    log_beam, log_range, scalars = tables
    row, column, ax, ay, u, height = at
    spacing = grid[2]
    z00, z01, z10, z11 = z[row, column], z[row, column + 1], z[row + 1, column], z[row + 1, column + 1]
    p = ((1 - ay) * (z01 - z00) + ay * (z11 - z10)) / spacing
    q = ((1 - ax) * (z10 - z00) + ax * (z11 - z01)) / spacing
    v = _along(line, u, height)
    dx, dy, dz = -(line[11] * u + line[9] * v), -(line[12] * u + line[10] * v), line[2] - height
    r = np.sqrt(dx * dx + dy * dy + dz * dz)
    m = dz - p * dx - q * dy
    s2 = 1 + p * p + q * q
    if m <= 1e-6 * r:
        return 0.0, r, 0.0, 0.0, 0.0, 0.0, 0.0
    along = -(dx * line[3] + dy * line[4] + dz * line[5])
    down = dx * line[6] + dy * line[7] + dz * line[8]
    theta = np.arctan2(along, down)
    knot = (theta - scalars[0]) / scalars[1]
    beam, beam_slope = _lookup(log_beam[side], knot)
    gain, gain_slope = _lookup(log_range, r / scalars[2])
    reflectivity = (1 - ay) * ((1 - ax) * rho[row, column] + ax * rho[row, column + 1]) + ay * (
        (1 - ax) * rho[row + 1, column] + ax * rho[row + 1, column + 1]
    )
    n = scalars[3]
    energy = np.exp(reflectivity + beam + gain + n * (np.log(m / r) - 0.5 * np.log(s2)) + 0.5 * np.log(s2))
    r_z = -dz / r
    theta_z = (down * line[5] + along * line[8]) / (along * along + down * down)
    by_z = beam_slope / scalars[1] * theta_z + gain_slope / scalars[2] * r_z - n * (1.0 / m + r_z / r)
    by_p = -n * (dx / m + p / s2) + p / s2
    by_q = -n * (dy / m + q / s2) + q / s2
    return energy, r, r_z, by_z, by_p, by_q, min(max(knot, 0.0), log_beam.shape[1] - 1.0)


@numba.njit(cache=True, inline="always")
def _next_seen(z, grid, line, u, height, horizon, end):  # type: ignore[no-untyped-def]
    """Walk on to the next sample in sight: cell (row -1 at the end), weights, place, height, elevation."""
    while True:
        u += 0.25 * grid[2]
        row, column, ax, ay, height = _place(z, grid, line, u, height)
        if row < 0:
            return row, column, ax, ay, u, height, horizon
        elevation = (height - line[2]) / u
        if elevation > horizon:
            return row, column, ax, ay, u, height, elevation
        if u >= end:
            return -1, column, ax, ay, u, height, horizon


@numba.njit(cache=True, inline="always")
def _bin(r, width):  # type: ignore[no-untyped-def]
    """The nearer of the two bins that share a sample, and the share of the farther."""
    b = r / width - 0.5
    i = int(np.floor(b))
    return i, b - i


@numba.njit(cache=True, nogil=True)
def _render(z, rho, grid, lines, tables, width, mu):  # type: ignore[no-untyped-def]
    area = 0.25 * grid[2] / width
    for ping in range(lines.shape[0]):
        for side in range(2):
            line, out = lines[ping, side], mu[ping, side]
            u, height, horizon = -0.125 * grid[2], z[z.shape[0] // 2, z.shape[1] // 2], -np.inf
            while True:
                row, column, ax, ay, u, height, horizon = _next_seen(
                    z, grid, line, u, height, horizon, width * out.size
                )
                if row < 0:
                    break
                at = (row, column, ax, ay, u, height)
                energy, r, _, _, _, _, _ = _sample(z, rho, grid, line, at, tables, side)
                if r >= width * out.size:
                    break
                i, f = _bin(r, width)
                if i >= 0:
                    out[i] += (1 - f) * energy * area
                if i + 1 < out.size:
                    out[i + 1] += f * energy * area


@numba.njit(cache=True, nogil=True)
def _pull_back(z, rho, grid, lines, tables, width, weight, gradients, by_beam):  # type: ignore[no-untyped-def]
    area = 0.25 * grid[2] / width
    for ping in range(lines.shape[0]):
        for side in range(2):
            line, w = lines[ping, side], weight[ping, side]
            u, height, horizon = -0.125 * grid[2], z[z.shape[0] // 2, z.shape[1] // 2], -np.inf
            while True:
                row, column, ax, ay, u, height, horizon = _next_seen(z, grid, line, u, height, horizon, width * w.size)
                if row < 0:
                    break
                at = (row, column, ax, ay, u, height)
                energy, r, r_z, by_z, by_p, by_q, knot = _sample(z, rho, grid, line, at, tables, side)
                if r >= width * w.size:
                    break
                i, f = _bin(r, width)
                near = w[i] if i >= 0 else 0.0
                far = w[i + 1] if i + 1 < w.size else 0.0
                g = area * energy * ((1 - f) * near + f * far)
                gz = g * by_z + area * energy * (far - near) * r_z / width
                _spread(gradients, at, g, gz, g * by_p / grid[2], g * by_q / grid[2])
                k = min(int(knot), by_beam.shape[1] - 2)
                by_beam[side, k] += g * (k + 1 - knot)
                by_beam[side, k + 1] += g * (knot - k)


@numba.njit(cache=True, inline="always")
def _spread(gradient, at, g, gz, gp, gq):  # type: ignore[no-untyped-def]
    """Share the gradient by reflectivity, height and the two slopes of a place among its four cells."""
    by_height, by_rho = gradient[0], gradient[1]
    row, column, ax, ay, _, _ = at
    by_height[row, column] += gz * (1 - ax) * (1 - ay) - gp * (1 - ay) - gq * (1 - ax)
    by_height[row, column + 1] += gz * ax * (1 - ay) + gp * (1 - ay) - gq * ax
    by_height[row + 1, column] += gz * (1 - ax) * ay - gp * ay + gq * (1 - ax)
    by_height[row + 1, column + 1] += gz * ax * ay + gp * ay + gq * ax
    by_rho[row, column] += g * (1 - ax) * (1 - ay)
    by_rho[row, column + 1] += g * ax * (1 - ay)
    by_rho[row + 1, column] += g * (1 - ax) * ay
    by_rho[row + 1, column + 1] += g * ax * ay


@numba.njit(cache=True, inline="always")
def _add(cells, heights, reflectivities, count, cell, by_height, by_rho):  # type: ignore[no-untyped-def]
    """Add to the entry of a cell in one row; a full row loses what is new."""
    for k in range(count - 1, -1, -1):
        if cells[k] == cell:
            heights[k] += by_height
            reflectivities[k] += by_rho
            return count
    if count == cells.size:
        return count
    cells[count], heights[count], reflectivities[count] = cell, by_height, by_rho
    return count + 1


@numba.njit(cache=True, nogil=True)
def _linearise(z, rho, grid, lines, tables, width, mu, rows):  # type: ignore[no-untyped-def]
    cell, by_height, by_rho, n_cells, shares, knots = rows
    spacing, area = grid[2], 0.25 * grid[2] / width
    for ping in range(lines.shape[0]):
        weights, slopes = np.empty(4), np.empty(4)
        for side in range(2):
            line, m = lines[ping, side], mu[ping, side]
            u, height, horizon = -0.125 * grid[2], z[z.shape[0] // 2, z.shape[1] // 2], -np.inf
            while True:
                row, column, ax, ay, u, height, horizon = _next_seen(z, grid, line, u, height, horizon, width * m.size)
                if row < 0:
                    break
                at = (row, column, ax, ay, u, height)
                energy, r, r_z, by_z, by_p, by_q, knot = _sample(z, rho, grid, line, at, tables, side)
                if r >= width * m.size:
                    break
                i, f = _bin(r, width)
                _corners(at, by_p / spacing, by_q / spacing, weights, slopes)
                for k in range(2):
                    if i + k < 0 or i + k >= m.size:
                        continue
                    e = area * energy / m[i + k]
                    share = e * (f if k == 1 else 1 - f)
                    shares[ping, side, i + k] += share
                    knots[ping, side, i + k] += share * knot
                    shift = e * r_z / width * (1.0 if k == 1 else -1.0)
                    for c in range(4):
                        n_cells[ping, side, i + k] = _add(
                            cell[ping, side, i + k],
                            by_height[ping, side, i + k],
                            by_rho[ping, side, i + k],
                            n_cells[ping, side, i + k],
                            (at[0] + c // 2) * grid[1] + at[1] + c % 2,
                            share * (by_z * weights[c] + slopes[c]) + shift * weights[c],
                            share * weights[c],
                        )


@numba.njit(cache=True, inline="always")
def _corners(at, gp, gq, weights, slopes):  # type: ignore[no-untyped-def]
    """Bilinear weights of the four cells around a place, and what the slopes there owe to each."""
    _, _, ax, ay, _, _ = at
    weights[0], weights[1] = (1 - ax) * (1 - ay), ax * (1 - ay)
    weights[2], weights[3] = (1 - ax) * ay, ax * ay
    slopes[0], slopes[1] = -gp * (1 - ay) - gq * (1 - ax), gp * (1 - ay) - gq * ax
    slopes[2], slopes[3] = -gp * ay + gq * (1 - ax), gp * ay + gq * ax


@numba.njit(cache=True, nogil=True)
def _coverage(z, grid, lines, end, passed, seen):  # type: ignore[no-untyped-def]
    step = 0.25 * grid[2]
    for ping in range(lines.shape[0]):
        for side in range(2):
            line = lines[ping, side]
            u, height, horizon = 0.5 * step, z[z.shape[0] // 2, z.shape[1] // 2], -np.inf
            while True:
                row, column, ax, ay, height = _place(z, grid, line, u, height)
                if row < 0 or u * u + (height - line[2]) ** 2 >= end * end:
                    break
                near = (int(row + ay + 0.5), int(column + ax + 0.5))
                passed[near] = True
                elevation = (height - line[2]) / u
                if elevation > horizon:
                    horizon = elevation
                    seen[near] = True
                u += step
