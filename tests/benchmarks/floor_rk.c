/* The chain of floor_rk.py with Tsitouras' method in plain C: gcc -O3 -march=native -shared -fPIC floor_rk.c -lm */
#include <math.h>
#include <stdint.h>

static inline void rhs(int n, const double *restrict data, double t, const double *restrict x, double *restrict dx)
{
    const double c = data[0], d = data[1];
    double before = data[3] * sin(data[4] * t);
    for (int i = 0; i < n - 1; i++) {
        dx[i] = x[n - 1 + i] - x[n + i];
        double torque = c * x[i] + d * dx[i];
        dx[n - 1 + i] = (before - torque) * data[5 + i];
        before = torque;
    }
    dx[2 * n - 2] = (before - data[2] * x[2 * n - 2]) * data[4 + n];
}

#define K(j) k[(j) * m + i]

/* a: rows of the tableau one after another, with the error row; r: interpolant; work: 10 m doubles */
int64_t chain(int64_t n, const double *data, double *restrict x, const double *times, int64_t samples, double *restrict out,
              const double *restrict atol, double rtol, double h, const double *a, const double *r, double *work)
{
    const int64_t m = 2 * n - 1;
    double *restrict k = work, *restrict y = work + 7 * m, *restrict xn = work + 8 * m;
    double t = times[0], t_end = times[samples - 1], log_old = log(1e-4);
    int64_t next = 0, steps = 0;
    rhs(n, data, t, x, k);
    while (t < t_end) {
        h = fmin(h, t_end - t);
        for (int64_t i = 0; i < m; i++) y[i] = x[i] + h * (a[0] * K(0));
        rhs(n, data, t + 0.161 * h, y, k + m);
        for (int64_t i = 0; i < m; i++) y[i] = x[i] + h * (a[1] * K(0) + a[2] * K(1));
        rhs(n, data, t + 0.327 * h, y, k + 2 * m);
        for (int64_t i = 0; i < m; i++) y[i] = x[i] + h * (a[3] * K(0) + a[4] * K(1) + a[5] * K(2));
        rhs(n, data, t + 0.9 * h, y, k + 3 * m);
        for (int64_t i = 0; i < m; i++) y[i] = x[i] + h * (a[6] * K(0) + a[7] * K(1) + a[8] * K(2) + a[9] * K(3));
        rhs(n, data, t + 0.9800255409045097 * h, y, k + 4 * m);
        for (int64_t i = 0; i < m; i++)
            y[i] = x[i] + h * (a[10] * K(0) + a[11] * K(1) + a[12] * K(2) + a[13] * K(3) + a[14] * K(4));
        rhs(n, data, t + h, y, k + 5 * m);
        for (int64_t i = 0; i < m; i++)
            xn[i] = x[i] + h * (a[15] * K(0) + a[16] * K(1) + a[17] * K(2) + a[18] * K(3) + a[19] * K(4) + a[20] * K(5));
        rhs(n, data, t + h, xn, k + 6 * m);
        double total = 0.0;
        for (int64_t i = 0; i < m; i++) {
            double e = a[21] * K(0) + a[22] * K(1) + a[23] * K(2) + a[24] * K(3) + a[25] * K(4) + a[26] * K(5) + a[27] * K(6);
            e /= atol[i] + rtol * fmax(fabs(x[i]), fabs(xn[i]));
            total += e * e;
        }
        double error = h * sqrt(total / m);
        steps++;
        if (!(error <= 1.0)) {
            h *= fmax(0.2, 0.9 * pow(error, -0.2));
            continue;
        }
        while (next < samples && times[next] <= t + h) {
            double theta = (times[next] - t) / h, b[7];
            for (int j = 0; j < 7; j++)
                b[j] = theta * (r[4 * j] + theta * (r[4 * j + 1] + theta * (r[4 * j + 2] + theta * r[4 * j + 3])));
            for (int64_t i = 0; i < m; i++)
                out[next * m + i] = x[i] + h * (b[0] * K(0) + b[1] * K(1) + b[2] * K(2) + b[3] * K(3) + b[4] * K(4)
                                                + b[5] * K(5) + b[6] * K(6));
            next++;
        }
        t = t + h < t_end * (1 - 1e-15) ? t + h : t_end;
        double log_error = log(fmax(error, 1e-10));
        h *= fmin(10.0, fmax(0.2, 0.9 * exp(0.08 * log_old - 0.14 * log_error)));
        log_old = log_error;
        for (int64_t i = 0; i < m; i++) {
            x[i] = fabs(xn[i]) > 1e-250 ? xn[i] : 0.0;
            K(0) = fabs(K(6)) > 1e-250 ? K(6) : 0.0;
        }
    }
    return steps;
}
