"""Pixels of a resampled image, and their positions in its source (``pixel_map``), compiled.

Every pixel is computed by itself, so that they are the same however they are divided. Inside, a pixel is the
weighted sum of the square of pixels around its position. Where one of these is not valid or beyond the
border, the bilinear mean of the valid ones among the nearest four takes its place, which cannot overshoot. A
pixel whose nearest one is not valid has the value of that one, and is not valid either.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel

_COARSE, _FINE = 64, 8


@small_kernel
def along_nodes(nodes, i, j, v, side, x, y, start):
    """Positions of ``side`` pixels from node j to the next, v of the way from row i of nodes to the next."""
    left_x = nodes[i, j, 0] + v * (nodes[i + 1, j, 0] - nodes[i, j, 0])
    left_y = nodes[i, j, 1] + v * (nodes[i + 1, j, 1] - nodes[i, j, 1])
    step_x = nodes[i, j + 1, 0] + v * (nodes[i + 1, j + 1, 0] - nodes[i, j + 1, 0]) - left_x
    step_y = nodes[i, j + 1, 1] + v * (nodes[i + 1, j + 1, 1] - nodes[i, j + 1, 1]) - left_y
    for k in range(side):
        x[start + k] = left_x + k / side * step_x
        y[start + k] = left_y + k / side * step_y


@kernel
def positions_of_cell(row, j, nodes, divided, fine, divided_again, finest, x, y):
    """Columns x (64,) and rows y (64,) in the source of the pixels of a row in cell j; NaN: none."""
    i = row // _COARSE
    cell, below = divided[i, j], row - i * _COARSE
    if cell < 0:
        along_nodes(nodes, i, j, below / _COARSE, _COARSE, x, y, 0)
        return
    i = below // _FINE
    below -= i * _FINE
    for k in range(_COARSE // _FINE):
        part = divided_again[cell, i, k]
        if part < 0:
            along_nodes(fine[cell], i, k, below / _FINE, _FINE, x, y, k * _FINE)
        else:
            for c in range(_FINE):
                x[k * _FINE + c] = finest[part, below, c, 0]
                y[k * _FINE + c] = finest[part, below, c, 1]


@kernel
def map_positions(column, row, nodes, divided, fine, divided_again, finest, found):
    """The positions found (n, 2) of pixels (n,), (n,)."""
    x, y = np.empty(_COARSE), np.empty(_COARSE)
    for k in range(len(column)):
        j = column[k] // _COARSE
        positions_of_cell(row[k], j, nodes, divided, fine, divided_again, finest, x, y)
        found[k, 0], found[k, 1] = x[column[k] - j * _COARSE], y[column[k] - j * _COARSE]


_CELL = 64


@small_kernel
def is_inside(x, y, rows, columns):
    """Whether a position is in one of the pixels of the image; NaN is not."""
    return columns[0] - 0.5 <= x < columns[1] + 0.5 and rows[0] - 0.5 <= y < rows[1] + 0.5


@small_kernel
def is_whole_square(valid, plane, top, left, taps, rows, columns):
    """Whether a square is within the image and all of it is valid; plane −1: all is."""
    if left < columns[0] or left + taps - 1 > columns[1] or top < rows[0] or top + taps - 1 > rows[1]:
        return False
    if plane >= 0:
        for i in range(taps):
            for j in range(taps):
                if not valid[plane, top + i, left + j]:
                    return False
    return True


@small_kernel
def weighted_sum(source, band, top, left, weights, a, b, taps):
    """Sum over a square, by row a of the weights along columns, row b along rows."""
    total = 0.0
    for i in range(taps):
        line = 0.0
        for j in range(taps):
            # Unsigned, so that no index is taken for one from the end.
            line += weights[a, j] * source[band, np.uintp(top + i), np.uintp(left + j)]
        total += weights[b, i] * line
    return total


@small_kernel
def bilinear_of_valid(source, band, valid, plane, top, left, u, v, rows, columns):
    """Bilinear mean of the valid ones of four pixels; the nearest is one of them."""
    total, weights = 0.0, 0.0
    for i in range(2):
        for j in range(2):
            row, column = top + i, left + j
            if row < rows[0] or row > rows[1] or column < columns[0] or column > columns[1]:
                continue
            if plane >= 0 and not valid[plane, row, column]:
                continue
            weight = (v if i else 1.0 - v) * (u if j else 1.0 - u)
            if weight > 0.0:
                total += weight * source[band, row, column]
                weights += weight
    return total / weights


@small_kernel
def storable(value, is_integer, least, largest, nodata):
    """A value as the type of the image can hold it, and none that means there is none."""
    if is_integer:
        value = np.floor(value + 0.5)
    value = min(max(value, least), largest)
    if value == nodata:
        value += 1.0 if value < largest else -1.0
    return value


@kernel
def resample_band(
    source, valid, band, x, y, count, weights, rows, columns, is_integer, least, largest, nodata, fill, out,
    r, start,
):  # fmt: skip
    """The pixels of a band from column start of row r on, at columns x and rows y (count,) of the source.

    rows, columns: the first and the last of the image, as rows and columns of source.
    """
    steps, taps = weights.shape[0] - 1, weights.shape[1]
    plane, reach = min(band, len(valid) - 1), taps // 2 - 1
    for c in range(count):
        if not is_inside(x[c], y[c], rows, columns):
            out[band, r, start + c] = fill
            continue
        left, top = int(np.floor(x[c])), int(np.floor(y[c]))
        u, v = x[c] - left, y[c] - top
        if plane >= 0:
            near_row, near_column = top + (v >= 0.5), left + (u >= 0.5)
            if not valid[plane, near_row, near_column]:
                out[band, r, start + c] = source[band, near_row, near_column]
                continue
        if is_whole_square(valid, plane, top - reach, left - reach, taps, rows, columns):
            a, b = int(u * steps + 0.5), int(v * steps + 0.5)
            value = weighted_sum(source, band, top - reach, left - reach, weights, a, b, taps)
        else:
            value = bilinear_of_valid(source, band, valid, plane, top, left, u, v, rows, columns)
        out[band, r, start + c] = storable(value, is_integer, least, largest, nodata)


@kernel
def nearest_of_plane(source, plane, x, y, count, rows, columns, fill, out, r, start):
    """The same of the nearest pixels."""
    for c in range(count):
        if is_inside(x[c], y[c], rows, columns):
            near_row, near_column = int(np.floor(y[c] + 0.5)), int(np.floor(x[c] + 0.5))
            out[plane, r, start + c] = source[plane, near_row, near_column]
        else:
            out[plane, r, start + c] = fill


@kernel
def resample(
    source, valid, origin, size, is_nearest, nodes, divided, fine, divided_again, finest, weights, is_integer,
    least, largest, nodata, fill, first, rows, out, out_valid,
):  # fmt: skip
    """Rows of out (bands, r, c), which begins at pixel first of the image; returns how many have no source.

    first: row and column, a multiple of 64. source (bands, h, w) begins at origin (row, column) of an image
    of size (rows, columns) and has all that is requested; valid (0, 1 or bands, h, w). Bands of is_nearest
    have the nearest pixel. weights (s + 1, taps) for s steps between two pixels. nodata NaN: none. fill is
    where there is no source; out_valid (1, r, c) is 1 where the nearest pixel of the first plane of valid is.
    """
    x, y = np.empty(_CELL), np.empty(_CELL)
    inside_rows = (-origin[0], size[0] - 1 - origin[0])
    inside_columns = (-origin[1], size[1] - 1 - origin[1])
    outside = 0
    for r in range(rows[0], rows[1]):
        row = first[0] + r
        for start in range(0, out.shape[2], _CELL):
            count = min(_CELL, out.shape[2] - start)
            cell = (first[1] + start) // _CELL
            positions_of_cell(row, cell, nodes, divided, fine, divided_again, finest, x, y)
            # Exact: a position in the source is not before its origin.
            x -= origin[1]
            y -= origin[0]
            for c in range(count):
                outside += not is_inside(x[c], y[c], inside_rows, inside_columns)
            if len(valid):
                nearest_of_plane(valid, 0, x, y, count, inside_rows, inside_columns, 0, out_valid, r, start)
            for band in range(len(source)):
                if is_nearest[band]:
                    nearest_of_plane(
                        source, band, x, y, count, inside_rows, inside_columns, fill, out, r, start
                    )
                else:
                    resample_band(
                        source, valid, band, x, y, count, weights, inside_rows, inside_columns, is_integer,
                        least, largest, nodata, fill, out, r, start,
                    )  # fmt: skip
    return outside
