"""Columns of the border (system parameters and joins) that the rays of one object point touch."""

from __future__ import annotations

from adjust.compiled import small_kernel


@small_kernel
def open_row(column, touched, local, position, rows):
    """Give a column of the border that one point touches a row (3,) of zeros, unless it has one.

    local (·,) has the columns that have a row, position (g,) the row of each column or −1; returns how many.
    """
    if position[column] < 0:
        position[column] = touched
        local[touched] = column
        rows[touched, :] = 0.0
        touched += 1
    return touched


@small_kernel
def open_rows(a, count, found, touched, local, position, rows):
    """The same for the columns found[a, :count] of a ray.

    All of them in one call: each call counts the references to its arrays, which takes longer than the work.
    """
    for s in range(count):
        column = found[a, s]
        if position[column] < 0:
            position[column] = touched
            local[touched] = column
            for q in range(rows.shape[1]):
                rows[touched, q] = 0.0
            touched += 1
    return touched


@small_kernel
def nonzero_columns(a, e, of_system, columns, found):
    """Free parameters of a ray with a derivative other than zero; returns how many.

    e is the picture of the ray. Their derivatives move to the front of of_system[a] (2, w), their columns go
    to found[a] (w,), in the same order. Most terms of composed images are zero outside one CCD.
    """
    count = 0
    for s in range(columns.shape[1]):
        column = columns[e, s]
        if column >= 0 and (of_system[a, 0, s] != 0.0 or of_system[a, 1, s] != 0.0):
            of_system[a, 0, count] = of_system[a, 0, s]
            of_system[a, 1, count] = of_system[a, 1, s]
            found[a, count] = column
            count += 1
    return count
