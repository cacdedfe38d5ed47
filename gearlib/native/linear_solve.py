"""Source of dense Gaussian elimination with complete pivoting, inlined into code with varying or nonlinear blocks."""

SOLVE = '''
def solve(data: floats, a: int, b: int, n: int, sides: int, agreeing: int, lead: int) -> int:
    """Gaussian elimination with complete pivoting, in place: the matrix at ``a``, right-hand sides and then solutions at ``b``.

    The ``sides`` right-hand sides are stored one after the other. Linearly dependent equations (two stuck clutches on one rigid path)
    are left out if the first ``agreeing`` right-hand sides are consistent, else the function returns 1; undetermined unknowns are set
    to zero. The first ``lead`` columns are lower triangular: their diagonal entries are the pivots, up to the first that is too small.
    The column order is stored behind the matrix, followed by the logarithm of the determinant and the largest magnitudes from which
    entries were computed: what is below their rounding is zero, however large or small the units make an entry.
    """
    p = a + n * n
    e = p + n + 1
    size = 0.0
    for i in range(n):
        data[p + i] = i
        s = 0.0
        for j in range(n):
            s = max(s, abs(data[a + i * n + j]))
        if s > 0.0:
            for j in range(n):
                data[a + i * n + j] /= s
                data[e + i * n + j] = abs(data[a + i * n + j])
            for side in range(sides):
                data[b + n * side + i] /= s
            size += log(s)
    rank = n
    for k in range(n):
        best, r, c = 0.0, k, k
        if k < lead and abs(data[a + k * n + k]) > 1e-6:
            best = 1.0
        else:
            lead = 0
        for i in range(k, n if lead == 0 else k):
            for j in range(k, n):
                if abs(data[a + i * n + j]) > best:
                    best, r, c = abs(data[a + i * n + j]), i, j
        if best <= 1e-20:  # zeros, and artificial compliances
            rank = k
            size = -1e300
            break
        size += log(abs(data[a + r * n + c]))
        if r != k:
            for j in range(n):
                data[a + k * n + j], data[a + r * n + j] = data[a + r * n + j], data[a + k * n + j]
                data[e + k * n + j], data[e + r * n + j] = data[e + r * n + j], data[e + k * n + j]
            for side in range(sides):
                h = b + n * side
                data[h + k], data[h + r] = data[h + r], data[h + k]
        if c != k:
            for i in range(n):
                data[a + i * n + k], data[a + i * n + c] = data[a + i * n + c], data[a + i * n + k]
                data[e + i * n + k], data[e + i * n + c] = data[e + i * n + c], data[e + i * n + k]
            data[p + k], data[p + c] = data[p + c], data[p + k]
        for i in range(k + 1, n):
            f = data[a + i * n + k] / data[a + k * n + k]
            if f != 0.0:
                for j in range(max(k + 1, lead), n):
                    s = data[a + i * n + j] - f * data[a + k * n + j]
                    data[e + i * n + j] = max(data[e + i * n + j], abs(f) * data[e + k * n + j])
                    data[a + i * n + j] = s if abs(s) > 1e-13 * data[e + i * n + j] else 0.0
                for side in range(sides):
                    h = b + n * side
                    data[h + i] -= f * data[h + k]
    data[p + n] = size
    for side in range(sides):
        h = b + n * side
        largest = 1e-300
        for i in range(rank):
            largest = max(largest, abs(data[h + i]))
        for i in range(rank, n):
            if side < agreeing and not abs(data[h + i]) <= 1e-9 * max(largest, 1.0):
                return 1
            data[h + i] = 0.0
        for k in range(rank - 1, -1, -1):
            s = data[h + k]
            for j in range(k + 1, rank):
                s -= data[a + k * n + j] * data[h + j]
            data[h + k] = s / data[a + k * n + k]
    for side in range(sides):
        h = b + n * side
        for i in range(n):
            data[a + i] = data[h + i]
        for i in range(n):
            data[h + int(data[p + i])] = data[a + i]
    return 0


'''
