"""Source of dense Gaussian elimination with complete pivoting, inlined into code with varying or nonlinear blocks."""

SOLVE = '''
def open_directions(data: floats, a: int, n: int, rank: int) -> None:
    """After an elimination with a lower rank: how the open unknowns, which come last, carry the others along.

    The solutions without right-hand side, one for each of the open unknowns, take the place of the magnitudes; the products of any two
    of them, weighted with the compliances, that of the remainder of the matrix, as factors of their triangular decomposition.
    """
    p, e = a + n * n, a + n * n + n + 1
    soft = e + n * n
    for c in range(rank, n):
        for k in range(rank - 1, -1, -1):
            s = -data[a + k * n + c]
            for j in range(k + 1, rank):
                s -= data[a + k * n + j] * data[e + c * n + j]
            data[e + c * n + k] = s / data[a + k * n + k]
        for k in range(rank, n):
            data[e + c * n + k] = 1.0 if k == c else 0.0
    for c in range(rank, n):
        for i in range(rank, n):
            s = 0.0
            for k in range(n):
                s += data[soft + int(data[p + k])] * data[e + c * n + k] * data[e + i * n + k]
            data[a + c * n + i] = s
    for c in range(rank, n):
        data[a + c * n] = 1e-13 * data[a + c * n + c]  # what is not more is rounding: no compliance tells this unknown
    for c in range(rank, n):
        if data[a + c * n + c] <= data[a + c * n]:
            data[a + c * n + c] = 0.0
        else:
            for i in range(c + 1, n):
                f = data[a + i * n + c] / data[a + c * n + c]
                for j in range(c + 1, n):
                    data[a + i * n + j] -= f * data[a + c * n + j]


def make_least(data: floats, a: int, n: int, rank: int, h: int) -> None:
    """Replace the solution at ``h``, whose open unknowns are zero, by the one with the least weighted squares."""
    p, e = a + n * n, a + n * n + n + 1
    soft = e + n * n
    for c in range(rank, n):
        s = 0.0
        for k in range(rank):
            s -= data[soft + int(data[p + k])] * data[e + c * n + k] * data[h + k]
        for i in range(rank, c):
            if data[a + i * n + i] > 0.0:
                s -= data[a + c * n + i] / data[a + i * n + i] * data[h + i]
        data[h + c] = s
    for c in range(n - 1, rank - 1, -1):
        s = data[h + c]
        for i in range(c + 1, n):
            s -= data[a + c * n + i] * data[h + i]
        data[h + c] = s / data[a + c * n + c] if data[a + c * n + c] > 0.0 else 0.0
    for c in range(rank, n):
        for k in range(rank):
            data[h + k] += data[e + c * n + k] * data[h + c]


def solve(data: floats, a: int, b: int, n: int, sides: int, agreeing: int, lead: int) -> int:
    """Gaussian elimination with complete pivoting, in place: the matrix at ``a``, right-hand sides and then solutions at ``b``.

    The ``sides`` right-hand sides are stored one after the other. Linearly dependent equations (two stuck clutches on one rigid path)
    are left out if the first ``agreeing`` right-hand sides are consistent, else the function returns 1. Of the unknowns that they leave
    open, those with artificial compliances are made as small as can be (the sum of their squares times these), and the others zero.
    The first ``lead`` columns are lower triangular: their diagonal entries are the pivots, up to the first that is too small. The
    column order is stored behind the matrix, followed by the logarithm of the determinant, the largest magnitudes from which entries
    were computed (what is below their rounding is zero, however large or small the units make an entry), and the compliances.
    """
    p = a + n * n
    e = p + n + 1
    soft = e + n * n
    size, shared = 0.0, 0.0
    for i in range(n):
        data[p + i], data[soft + i] = 0.0, 0.0
    for i in range(n):
        s = 0.0
        for j in range(n):
            s = max(s, abs(data[a + i * n + j]))
            data[p + j] = max(data[p + j], abs(data[a + i * n + j]))
        if s > 0.0:
            for j in range(n):
                data[a + i * n + j] /= s
                data[e + i * n + j] = abs(data[a + i * n + j])
                if 0.0 < abs(data[a + i * n + j]) <= 1e-20:
                    data[soft + j] = abs(data[a + i * n + j])
            for side in range(sides):
                data[b + n * side + i] /= s
            size += log(s)
    for j in range(n):  # torque by the acceleration: in the balance, 1 of it may hold more than 1
        data[p + j], data[soft + j] = j, data[soft + j] * data[p + j]
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
            for j in range(n):
                shared += data[soft + j]
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
    if shared > 0.0:
        open_directions(data, a, n, rank)
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
        if shared > 0.0:
            make_least(data, a, n, rank, h)
    for side in range(sides):
        h = b + n * side
        for i in range(n):
            data[a + i] = data[h + i]
        for i in range(n):
            data[h + int(data[p + i])] = data[a + i]
    return 0


'''
