"""Kernels of the forward model: the walk along one line of a ping, and what is gathered on the way.

A line is a row of 16 numbers: transducer (0-2), side axis (3-5), up axis (6-8), heading (9-10), the horizontal
direction of the walk (11-12), the tangent of the pitch, nose down (13), and how far the echo's place runs along with
the vehicle while sound is under way: by its speed [1] (14) and its turn [1/m] (15). ``grid`` is rows, columns, spacing
and origin; ``tables`` are beam pattern, range law (one row) and their first knots and steps. Divisors are lengths above
zero: the error model without checks of them spares branches in every sample.
"""

import numba
import numpy as np


@numba.njit(cache=True, inline="always", error_model="numpy")
def _lookup(table, row, position):  # type: ignore[no-untyped-def]
    """Value and slope (a knot) of a row of a table at a fractional knot, held at the ends."""
    last = table.shape[1] - 1
    held = min(max(position, 0.0), float(last))
    i = min(int(held), last - 1)
    slope = table[row, i + 1] - table[row, i]
    return table[row, i] + slope * (held - i), slope * (held == position)


@numba.njit(cache=True, inline="always", error_model="numpy")
def _along(line, u, height):  # type: ignore[no-untyped-def]
    """Distance along track of the place that is heard at across-track distance u."""
    return line[13] * (height - line[2]) + u * (line[14] + line[15] * u)


@numba.njit(cache=True, inline="always", error_model="numpy")
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


@numba.njit(cache=True, error_model="numpy")
def _walk(z, grid, line, end, path):  # type: ignore[no-untyped-def]
    """Walk a line to its end: fractional column and row, distance and height of every sample in sight; their number."""
    u, height, horizon, n = -0.125 * grid[2], z[z.shape[0] // 2, z.shape[1] // 2], -np.inf, 0
    while n < path.shape[0]:
        u += 0.25 * grid[2]
        row, column, ax, ay, height = _place(z, grid, line, u, height)
        if row < 0:
            break
        elevation = (height - line[2]) / u
        if elevation > horizon:
            horizon = elevation
            path[n, 0], path[n, 1], path[n, 2], path[n, 3] = column + ax, row + ay, u, height
            n += 1
        elif u >= end:
            break
    return n


@numba.njit(cache=True, inline="always", error_model="numpy")
def _new_path(grid, end):  # type: ignore[no-untyped-def]
    """Room for the samples of a line."""
    return np.empty((int(end / (0.25 * grid[2])) + 4, 4))


@numba.njit(cache=True, inline="always", error_model="numpy")
def _sample(z, rho, spacing, line, at, tables, side):  # type: ignore[no-untyped-def]
    """Energy of a sample; range and its derivative; derivatives of ln energy by height and slopes; knot of the beam."""
    log_beam, log_range, scalars = tables
    fx, fy, u, height = at
    row, column = int(fy), int(fx)
    ax, ay = fx - column, fy - row
    z00, z01, z10, z11 = z[row, column], z[row, column + 1], z[row + 1, column], z[row + 1, column + 1]
    p = ((1 - ay) * (z01 - z00) + ay * (z11 - z10)) / spacing
    q = ((1 - ax) * (z10 - z00) + ax * (z11 - z01)) / spacing
    v = _along(line, u, height)
    dx, dy, dz = -(line[11] * u + line[9] * v), -(line[12] * u + line[10] * v), line[2] - height
    r = np.sqrt(dx * dx + dy * dy + dz * dz)
    facing = dz - p * dx - q * dy
    m = max(facing, 1e-6 * r)
    s2 = 1 + p * p + q * q
    along = -(dx * line[3] + dy * line[4] + dz * line[5])
    down = dx * line[6] + dy * line[7] + dz * line[8]
    theta = np.arctan2(along, down)
    knot = (theta - scalars[0]) / scalars[1]
    beam, beam_slope = _lookup(log_beam, side, knot)
    gain, gain_slope = _lookup(log_range, 0, r / scalars[2])
    reflectivity = (1 - ay) * ((1 - ax) * rho[row, column] + ax * rho[row, column + 1]) + ay * (
        (1 - ax) * rho[row + 1, column] + ax * rho[row + 1, column + 1]
    )
    n, stretch = scalars[3], np.sqrt(s2)
    energy = stretch * np.exp(reflectivity + beam + gain + n * np.log(m / (r * stretch))) * (facing == m)
    r_z = -dz / r
    theta_z = (down * line[5] + along * line[8]) / (along * along + down * down)
    by_z = beam_slope / scalars[1] * theta_z + gain_slope / scalars[2] * r_z - n * (1.0 / m + r_z / r)
    by_p = -n * (dx / m + p / s2) + p / s2
    by_q = -n * (dy / m + q / s2) + q / s2
    return energy, r, r_z, by_z, by_p, by_q, min(max(knot, 0.0), log_beam.shape[1] - 1.0)


@numba.njit(cache=True, inline="always", error_model="numpy")
def _bin(r, width):  # type: ignore[no-untyped-def]
    """The nearer of the two bins that share a sample, and the share of the farther."""
    b = r / width - 0.5
    i = int(np.floor(b))
    return i, b - i


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _render(z, rho, grid, lines, tables, width, mu):  # type: ignore[no-untyped-def]
    area, end = 0.25 * grid[2] / width, width * mu.shape[2]
    path = _new_path(grid, end)
    for ping in range(lines.shape[0]):
        for side in range(2):
            line, out = lines[ping, side], mu[ping, side]
            for k in range(_walk(z, grid, line, end, path)):
                at = (path[k, 0], path[k, 1], path[k, 2], path[k, 3])
                energy, r, _, _, _, _, _ = _sample(z, rho, grid[2], line, at, tables, side)
                if r >= end:
                    break
                i, f = _bin(r, width)
                if i >= 0:
                    out[i] += (1 - f) * energy * area
                if i + 1 < out.size:
                    out[i + 1] += f * energy * area


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _pull_back(z, rho, grid, lines, tables, width, weight, gradients, by_beam):  # type: ignore[no-untyped-def]
    area, end = 0.25 * grid[2] / width, width * weight.shape[2]
    path = _new_path(grid, end)
    for ping in range(lines.shape[0]):
        for side in range(2):
            line, w = lines[ping, side], weight[ping, side]
            for s in range(_walk(z, grid, line, end, path)):
                at = (path[s, 0], path[s, 1], path[s, 2], path[s, 3])
                energy, r, r_z, by_z, by_p, by_q, knot = _sample(z, rho, grid[2], line, at, tables, side)
                if r >= end:
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


@numba.njit(cache=True, inline="always", error_model="numpy")
def _spread(gradient, at, g, gz, gp, gq):  # type: ignore[no-untyped-def]
    """Share the gradient by reflectivity, height and the two slopes of a place among its four cells."""
    row, column = int(at[1]), int(at[0])
    ax, ay = at[0] - column, at[1] - row
    gradient[0, row, column] += gz * (1 - ax) * (1 - ay) - gp * (1 - ay) - gq * (1 - ax)
    gradient[0, row, column + 1] += gz * ax * (1 - ay) + gp * (1 - ay) - gq * ax
    gradient[0, row + 1, column] += gz * (1 - ax) * ay - gp * ay + gq * (1 - ax)
    gradient[0, row + 1, column + 1] += gz * ax * ay + gp * ay + gq * ax
    gradient[1, row, column] += g * (1 - ax) * (1 - ay)
    gradient[1, row, column + 1] += g * ax * (1 - ay)
    gradient[1, row + 1, column] += g * (1 - ax) * ay
    gradient[1, row + 1, column + 1] += g * ax * ay


@numba.njit(cache=True, error_model="numpy")
def _add(rows, bin_, count, first, factors, corners):  # type: ignore[no-untyped-def]
    """Add a sample's derivatives by its four cells to the row of a bin; a full row loses what is new."""
    cells, heights, reflectivities = rows
    weights, slopes = corners
    for c in range(4):
        cell, k = first[0] + (c // 2) * first[1] + c % 2, count - 1
        while k >= 0 and cells[bin_, k] != cell:
            k -= 1
        if k < 0 and count < cells.shape[1]:
            k, count = count, count + 1
            cells[bin_, k], heights[bin_, k], reflectivities[bin_, k] = cell, 0.0, 0.0
        if k >= 0:
            heights[bin_, k] += factors[0] * slopes[c] + factors[1] * weights[c]
            reflectivities[bin_, k] += factors[0] * weights[c]
    return count


@numba.njit(cache=True, inline="always", error_model="numpy")
def _cell(at, grid):  # type: ignore[no-untyped-def]
    """Number of the cell before a place, and how many lie in a row."""
    return int(at[1]) * grid[1] + int(at[0]), grid[1]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _linearise(z, rho, grid, lines, tables, width, mu, rows):  # type: ignore[no-untyped-def]
    spacing, area, end = grid[2], 0.25 * grid[2] / width, width * mu.shape[2]
    path = _new_path(grid, end)
    for ping in range(lines.shape[0]):
        for side in range(2):
            line, m = lines[ping, side], mu[ping, side]
            of_line = (rows[0][ping, side], rows[1][ping, side], rows[2][ping, side])
            n_cells, shares, knots = rows[3][ping, side], rows[4][ping, side], rows[5][ping, side]
            for s in range(_walk(z, grid, line, end, path)):
                at = (path[s, 0], path[s, 1], path[s, 2], path[s, 3])
                energy, r, r_z, by_z, by_p, by_q, knot = _sample(z, rho, spacing, line, at, tables, side)
                if r >= end:
                    break
                i, f = _bin(r, width)
                first, corners = _cell(at, grid), _corners(at, by_p / spacing, by_q / spacing)
                for k in range(max(i, 0), min(i + 2, m.size)):
                    e = area * energy / m[k]
                    share, shift = (e * f, e * r_z / width) if k > i else (e * (1 - f), -e * r_z / width)
                    shares[k] += share
                    knots[k] += share * knot
                    factors = (share, share * by_z + shift)
                    n_cells[k] = _add(of_line, k, n_cells[k], first, factors, corners)


@numba.njit(cache=True, inline="always", error_model="numpy")
def _corners(at, gp, gq):  # type: ignore[no-untyped-def]
    """Bilinear weights of the four cells around a place, and what the slopes there owe to each."""
    ax, ay = at[0] - int(at[0]), at[1] - int(at[1])
    weights = ((1 - ax) * (1 - ay), ax * (1 - ay), (1 - ax) * ay, ax * ay)
    slopes = (-gp * (1 - ay) - gq * (1 - ax), gp * (1 - ay) - gq * ax, -gp * ay + gq * (1 - ax), gp * ay + gq * ax)
    return weights, slopes


@numba.njit(cache=True, nogil=True, error_model="numpy")
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
