"""Columns of the border (system parameters and joins) that the rays of one object point touch, in fours.

Four columns that stand side by side, c, c + 1, c + 2, c + 3 with c a multiple of four, are a *tile*. Rays are
sorted into tiles, with zeros for the columns of a tile that they do not touch: four values that are loaded
before the first of their sums is stored are worked on together, and the place of a tile is found once.
"""

from __future__ import annotations

from adjust.compiled import small_kernel

#: Columns of a tile.
TILE = 4


@small_kernel
def open_tile(tile, touched, local, position, rows, height):
    """Give a tile of the border that one point touches so many rows (·, 4) of zeros, unless it has some.

    local (·,) has the tiles that have rows, position (t,) the place of each tile or −1; returns how many.
    """
    if position[tile] < 0:
        position[tile] = touched
        local[touched] = tile
        for q in range(height):
            for s in range(TILE):
                rows[height * touched + q, s] = 0.0
        touched += 1
    return touched


@small_kernel
def tiles_of_ray(a, e, of_system, columns, found, tiled):
    """Derivatives of a ray by free parameters, other than zero, in tiles; returns how many tiles.

    e is the picture of the ray, a its row. The tiles go to found[a] (w,), the derivatives of the two
    coordinates of its i-th one to the rows 2 (w a + i) and the one behind of tiled (·, 4). Most terms of
    composed images are zero outside one CCD.
    """
    count = 0
    last = -1
    first = 2 * found.shape[1] * a
    for s in range(columns.shape[1]):
        column = columns[e, s]
        if column >= 0 and (of_system[a, 0, s] != 0.0 or of_system[a, 1, s] != 0.0):
            tile = column // TILE
            if tile != last:  # the columns of an image ascend
                for k in range(TILE):
                    tiled[first + 2 * count, k] = 0.0
                    tiled[first + 2 * count + 1, k] = 0.0
                found[a, count] = tile
                count += 1
                last = tile
            tiled[first + 2 * count - 2, column - TILE * tile] = of_system[a, 0, s]
            tiled[first + 2 * count - 1, column - TILE * tile] = of_system[a, 1, s]
    return count
