"""Moving blocks in and out of the fronts of Helmert blocking, compiled.

A front is symmetric and in Fortran order; its lower triangle is kept in two parts: ``columns``
(p + q, p) of the unknowns that are eliminated here, and ``rest`` (q, q) of those that stay. The kernels
get the transposes: these are contiguous by rows, also with a single row or none, so that every kernel is
compiled once. The second index is the row of the front.
"""

from adjust.compiled import kernel


@kernel
def assemble(columns, blocks, chosen, lower, upper, transposed, images, scale):
    """Write the chosen 6 × 6 blocks of the matrix into the columns of a front, scaled.

    lower, upper say where in the front a block stands, in exposures; transposed, whether the matrix
    holds it the other way round. scale (n, 6) belongs to the exposures of the block.
    """
    for k in range(chosen.shape[0]):
        block = blocks[chosen[k]]
        row = 6 * lower[k]
        column = 6 * upper[k]
        of_row = scale[images[lower[k]]]
        of_column = scale[images[upper[k]]]
        for j in range(6):
            for i in range(6):
                value = block[j, i] if transposed[k] else block[i, j]
                columns[column + j, row + i] = of_row[i] * value * of_column[j]


@kernel
def extend(columns, rest, update, at):
    """Add the lower triangle of what is left of a child (k, k); at (k,) is ascending."""
    p = columns.shape[0]
    for j in range(update.shape[0]):
        column = at[j]
        if column < p:
            for i in range(j, update.shape[0]):
                columns[column, at[i]] += update[j, i]
        else:
            for i in range(j, update.shape[0]):
                rest[column - p, at[i] - p] += update[j, i]


@kernel
def gather(whole, at, result, first):
    """Rows and columns at (k,), ascending, of a lower triangle, into that of result from ``first`` on."""
    for j in range(at.shape[0]):
        column = at[j]
        for i in range(j, at.shape[0]):
            result[first + j, first + i] = whole[column, at[i]]


@kernel
def subtract_at(vectors, exposures, columns, part):
    """Subtract a part (e, 6, k) from some exposures (e,) and columns (k,) of vectors (n, 6, c)."""
    for e in range(exposures.shape[0]):
        for i in range(6):
            row = vectors[exposures[e], i]
            for t in range(columns.shape[0]):
                row[columns[t]] -= part[e, i, t]


@kernel
def disassemble(inverse, chosen, lower, upper, transposed, images, scale, blocks):
    """The opposite of :func:`assemble`: write the places of the chosen blocks in the inverse to blocks."""
    for k in range(chosen.shape[0]):
        block = blocks[chosen[k]]
        row = 6 * lower[k]
        column = 6 * upper[k]
        of_row = scale[images[lower[k]]]
        of_column = scale[images[upper[k]]]
        for j in range(6):
            # Above the diagonal of the front nothing is kept.
            for i in range(j if row == column else 0, 6):
                value = of_row[i] * inverse[column + j, row + i] * of_column[j]
                if row == column:
                    block[i, j] = value
                    block[j, i] = value
                elif transposed[k]:
                    block[j, i] = value
                else:
                    block[i, j] = value
