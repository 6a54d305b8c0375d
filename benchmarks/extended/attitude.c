/* The attitude of a free body in extended precision: a truth for benchmarks that shares no code with the library.

   The body is a tree of links (Rodrigues' formula for every joint), the path of its joints a sum of terms in time, the
   integrator that of Gragg, Bulirsch and Stoer (extrapolated midpoint rule, order 16, step by step to an error per step
   far below double rounding). Everything is long double: 64 bits of mantissa on x86. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef long double real;
enum { MOST_JOINTS = 256, COLUMNS = 8, TERM = 7 };
enum { CONSTANT, HARMONIC, GAUSSIAN, RAMP, BURST, BUMP, FOURIER };
#define TURN 6.283185307179586476925286766559005768L

typedef struct {
    int joints, shapes;
    const int *parent;
    const double *turn, *place, *axis, *slide, *mass, *centre, *inertia, *matrix, *offset;
} Body;

typedef struct {
    int terms, order, pieces;
    const double *term;          /* TERM numbers each: kind, coordinate, amplitude, centre or frequency, width, frequency, phase */
    const double *knots, *series; /* polynomials (order, pieces, shapes), on the piece that ends or begins at the break */
    double origin, pace;          /* the curve is followed at origin + pace*t; backwards where the pace is negative */
} Path;

static void multiply(const real *a, const real *b, real *c)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) c[3*i + j] = a[3*i]*b[j] + a[3*i + 1]*b[3 + j] + a[3*i + 2]*b[6 + j];
}

static void apply(const real *a, const real *x, real *y)
{
    for (int i = 0; i < 3; i++) y[i] = a[3*i]*x[0] + a[3*i + 1]*x[1] + a[3*i + 2]*x[2];
}

static void cross(const real *a, const real *b, real *c)
{
    c[0] = a[1]*b[2] - a[2]*b[1]; c[1] = a[2]*b[0] - a[0]*b[2]; c[2] = a[0]*b[1] - a[1]*b[0];
}

/* Shapes and rates at `time`, on the piece of the path numbered `piece`. */
static void follow(const Path *path, int shapes, int piece, real time, real *q, real *v)
{
    real pace = path->pace, t = (real)path->origin + pace*time;
    if (pace < 0) piece = path->pieces - 1 - piece;
    for (int i = 0; i < shapes; i++) q[i] = v[i] = 0;
    for (int k = 0; k < path->terms; k++) {
        const double *e = path->term + TERM*k;
        int i = (int)e[1];
        real a = e[2], s = t - (real)e[3], width = e[4], w = e[5], phase = e[6], x, g;
        switch ((int)e[0]) {
        case CONSTANT: q[i] += a; break;
        case HARMONIC: q[i] += a*sinl(w*s + phase); v[i] += a*w*cosl(w*s + phase); break;
        /* Of `frequency` periods of the length `width`: no multiple of 2 pi is rounded to a double. */
        case FOURIER: w = w*TURN/width;
                      q[i] += a*sinl(w*s + phase*TURN); v[i] += a*w*cosl(w*s + phase*TURN); break;
        case GAUSSIAN: x = s/width; g = a*expl(-x*x); q[i] += g; v[i] -= 2*x/width*g; break;
        case RAMP: x = tanhl(s/width); q[i] += a*x; v[i] += a*(1 - x*x)/width; break;
        case BURST: x = s/width; g = a*expl(-x*x); q[i] += g*sinl(w*s + phase);
                    v[i] += g*(w*cosl(w*s + phase) - 2*x/width*sinl(w*s + phase)); break;
        case BUMP: x = s/width; if (x*x < 1) { real d = 1 - x*x; g = a*expl(1 - 1/d); q[i] += g; v[i] -= g*2*x/(d*d*width); } break;
        }
    }
    if (path->order) {
        real s = t - (real)path->knots[piece];
        for (int i = 0; i < shapes; i++) {
            real value = 0, slope = 0;
            for (int p = path->order - 1; p >= 0; p--) {
                slope = slope*s + value;
                value = value*s + (real)path->series[(p*path->pieces + piece)*shapes + i];
            }
            q[i] += value; v[i] += slope;
        }
    }
    for (int i = 0; i < shapes; i++) v[i] *= pace;
}

/* Locked inertia and internal momentum about the centre of mass, axes of the base. */
static void locked(const Body *b, const real *shape, const real *rate, real *inertia, real *momentum)
{
    static _Thread_local real turn[MOST_JOINTS + 1][9], place[MOST_JOINTS + 1][3], spin[MOST_JOINTS + 1][3], speed[MOST_JOINTS + 1][3];
    real mass = 0, first[3] = {0}, flow[3] = {0}, about[9] = {0}, angular[3] = {0};
    for (int i = 0; i < 9; i++) turn[0][i] = i % 4 == 0;
    for (int i = 0; i < 3; i++) place[0][i] = spin[0][i] = speed[0][i] = 0;
    for (int k = -1; k < b->joints; k++) {
        int f = k + 1;
        if (k >= 0) {
            int p = b->parent[k];
            real q = b->offset[k], v = 0, step[9], own[9], slide[3], local[3], axis[3], arm[3], extra[3];
            for (int i = 0; i < b->shapes; i++) { q += (real)b->matrix[k*b->shapes + i]*shape[i]; v += (real)b->matrix[k*b->shapes + i]*rate[i]; }
            real x = b->axis[3*k], y = b->axis[3*k + 1], z = b->axis[3*k + 2], size = sqrtl(x*x + y*y + z*z);
            if (size > 0) { x /= size; y /= size; z /= size; }
            real s = sinl(q), c = 1 - cosl(q);
            if (!(size > 0)) s = c = 0;
            real rodrigues[9] = {1 - c*(y*y + z*z), c*x*y - s*z, c*x*z + s*y, c*x*y + s*z, 1 - c*(x*x + z*z), c*y*z - s*x,
                                 c*x*z - s*y, c*y*z + s*x, 1 - c*(x*x + y*y)};
            for (int i = 0; i < 9; i++) own[i] = b->turn[9*k + i];
            multiply(turn[p], own, step);
            multiply(step, rodrigues, turn[f]);
            for (int i = 0; i < 3; i++) slide[i] = b->slide[3*k + i];
            apply(step, slide, extra);
            real a[3] = {x, y, z};
            apply(step, a, axis);
            for (int i = 0; i < 3; i++) local[i] = b->place[3*k + i];
            apply(turn[p], local, arm);
            for (int i = 0; i < 3; i++) place[f][i] = place[p][i] + arm[i] + q*extra[i];
            real reach[3] = {place[f][0] - place[p][0], place[f][1] - place[p][1], place[f][2] - place[p][2]}, carried[3];
            cross(spin[p], reach, carried);
            for (int i = 0; i < 3; i++) { speed[f][i] = speed[p][i] + carried[i] + v*extra[i]; spin[f][i] = spin[p][i] + v*axis[i]; }
        }
        real m = b->mass[f], centre[3], lever[3], x[3], u[3], own[9], half[9], back[9], whole[9];
        for (int i = 0; i < 3; i++) centre[i] = b->centre[3*f + i];
        apply(turn[f], centre, lever);
        cross(spin[f], lever, u);
        for (int i = 0; i < 3; i++) { x[i] = place[f][i] + lever[i]; u[i] += speed[f][i]; }
        for (int i = 0; i < 9; i++) own[i] = b->inertia[9*f + i];
        multiply(turn[f], own, half);
        for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) back[3*i + j] = turn[f][3*j + i];
        multiply(half, back, whole);
        real square = x[0]*x[0] + x[1]*x[1] + x[2]*x[2], own_spin[3], lift[3];
        for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) about[3*i + j] += whole[3*i + j] + m*((i == j)*square - x[i]*x[j]);
        apply(whole, spin[f], own_spin);
        cross(x, u, lift);
        for (int i = 0; i < 3; i++) { angular[i] += own_spin[i] + m*lift[i]; first[i] += m*x[i]; flow[i] += m*u[i]; }
        mass += m;
    }
    real square = (first[0]*first[0] + first[1]*first[1] + first[2]*first[2])/mass, lift[3];
    for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) inertia[3*i + j] = about[3*i + j] - ((i == j)*square - first[i]*first[j]/mass);
    cross(first, flow, lift);
    for (int i = 0; i < 3; i++) momentum[i] = angular[i] - lift[i]/mass;
}

static void solve(const real *a, const real *x, real *y)
{
    real m[9] = {a[4]*a[8] - a[5]*a[7], a[2]*a[7] - a[1]*a[8], a[1]*a[5] - a[2]*a[4], a[5]*a[6] - a[3]*a[8], a[0]*a[8] - a[2]*a[6],
                 a[2]*a[3] - a[0]*a[5], a[3]*a[7] - a[4]*a[6], a[1]*a[6] - a[0]*a[7], a[0]*a[4] - a[1]*a[3]};
    real det = a[0]*m[0] + a[1]*m[3] + a[2]*m[6], out[3];
    apply(m, x, out);
    for (int i = 0; i < 3; i++) y[i] = out[i]/det;
}

/* The rate of the quaternion x y z w of the attitude; `start` is the momentum seen from the body at the start. */
static void slope(const Body *b, const Path *path, int piece, real t, const real *start, const real *quaternion, real *rate)
{
    real q[MOST_JOINTS], v[MOST_JOINTS], inertia[9], internal[3], spin[3], n = 0, u[4];
    follow(path, b->shapes, piece, t, q, v);
    locked(b, q, v, inertia, internal);
    for (int i = 0; i < 4; i++) n += quaternion[i]*quaternion[i];
    n = 1/sqrtl(n);
    for (int i = 0; i < 4; i++) u[i] = quaternion[i]*n;
    real x = u[0], y = u[1], z = u[2], w = u[3];
    real seen[3] = {
        (1 - 2*(y*y + z*z))*start[0] + 2*(x*y + w*z)*start[1] + 2*(x*z - w*y)*start[2] - internal[0],
        2*(x*y - w*z)*start[0] + (1 - 2*(x*x + z*z))*start[1] + 2*(y*z + w*x)*start[2] - internal[1],
        2*(x*z + w*y)*start[0] + 2*(y*z - w*x)*start[1] + (1 - 2*(x*x + y*y))*start[2] - internal[2]};
    solve(inertia, seen, spin);
    real p = spin[0]/2, r = spin[1]/2, s = spin[2]/2;
    rate[0] = w*p + y*s - z*r; rate[1] = w*r + z*p - x*s; rate[2] = w*s + x*r - y*p; rate[3] = -(x*p + y*r + z*s);
}

/* One step of the extrapolated midpoint rule; the difference of the last two columns estimates its error. */
static real leap(const Body *b, const Path *path, int piece, real t, real h, const real *start, const real *from, real *to)
{
    real table[COLUMNS][4], before[4], now[4], next[4], rate[4], first[4], worst = 0, counts[COLUMNS];
    slope(b, path, piece, t, start, from, first);
    for (int j = 0; j < COLUMNS; j++) {
        int count = 2*(j + 1);
        real step = h/count, old[4];
        for (int i = 0; i < 4; i++) { before[i] = from[i]; now[i] = from[i] + step*first[i]; }
        for (int k = 1; k < count; k++) {
            slope(b, path, piece, t + k*step, start, now, rate);
            for (int i = 0; i < 4; i++) { next[i] = before[i] + 2*step*rate[i]; before[i] = now[i]; now[i] = next[i]; }
        }
        slope(b, path, piece, t + h, start, now, rate);
        for (int i = 0; i < 4; i++) old[i] = (now[i] + before[i] + step*rate[i])/2;
        counts[j] = count;
        memcpy(table[j], old, sizeof old);
    }
    /* Aitken and Neville in the squares of the steps, from the finest back. */
    for (int k = 1; k < COLUMNS; k++)
        for (int j = COLUMNS - 1; j >= k; j--) {
            real ratio = counts[j]/counts[j - k], factor = 1/(ratio*ratio - 1);
            for (int i = 0; i < 4; i++) {
                real change = (table[j][i] - table[j - 1][i])*factor;
                if (k == COLUMNS - 1) worst = fmaxl(worst, fabsl(change));
                table[j][i] += change;
            }
        }
    memcpy(to, table[COLUMNS - 1], 4*sizeof(real));
    return worst;
}

/* Quaternions (count, 4) at ascending `times` from `breaks[0]` on; the error per step stays below `tolerance`.
   `state` is the quaternion at the start, and then at the end; `steps` how many may be tried, and then are left.
   Returns the sum of the errors of all steps, -1 where the steps became too short, or -2 where they were too many. */
double attitudes(const Body *b, const Path *path, int breaks, const double *edge, const double *momentum, double tolerance,
                 int count, const double *times, long double *out, long double *state, long *steps)
{
    real next[4], start[3] = {momentum[0], momentum[1], momentum[2]}, total = 0, h = (real)(edge[1] - edge[0])/8, t = edge[0];
    int k = 0;
    while (k < count && times[k] <= edge[0]) { for (int i = 0; i < 4; i++) out[4*k + i] = state[i]; k++; }
    for (int piece = 0; piece + 1 < breaks; piece++) {
        real end = edge[piece + 1];
        h = fminl(h, end - (real)edge[piece]);
        while (t < end) {
            real stop = k < count && times[k] < end ? (real)times[k] : end, step = fminl(h, stop - t);
            if (--*steps < 0) return -2;
            real error = leap(b, path, piece, t, step, start, state, next);
            if (!(error <= tolerance)) {
                h = step*(error > 0 && isfinite(error) ? fmaxl(0.2L, 0.8L*powl(tolerance/error, 1.0L/15)) : 0.2L);
                if (h < 1e-12L*(edge[breaks - 1] - edge[0])) return -1;
                continue;
            }
            real n = 0;
            for (int i = 0; i < 4; i++) n += next[i]*next[i];
            n = 1/sqrtl(n);
            for (int i = 0; i < 4; i++) state[i] = next[i]*n;
            total += error;
            if (step == h || error > 0) h = fmaxl(h, step*fminl(3, 0.8L*powl(tolerance/fmaxl(error, 1e-30L), 1.0L/15)));
            t = step == stop - t ? stop : t + step;
            while (k < count && t >= (real)times[k]) { for (int i = 0; i < 4; i++) out[4*k + i] = state[i]; k++; }
        }
    }
    return (double)total;
}

/* Locked inertia (9) and internal momentum (3) at shapes and rates (count, shapes). */
void bodies(const Body *b, int count, const double *shapes, const double *rates, long double *out)
{
    real q[MOST_JOINTS], v[MOST_JOINTS];
    for (int k = 0; k < count; k++) {
        for (int i = 0; i < b->shapes; i++) { q[i] = shapes[k*b->shapes + i]; v[i] = rates[k*b->shapes + i]; }
        locked(b, q, v, out + 12*k, out + 12*k + 9);
    }
}
