// What a good engineer writes in C++ for the attitude of a free body: Pinocchio's `ccrba` in Boost.odeint's adaptive
// method of Runge, Kutta and Fehlberg, order 7(8), on the quaternion, from one break of the path to the next.
//
// Built and called by peer.py. Joints follow a sum of terms, polynomials between knots, or a Fourier series, all as
// functions of time in C++. The step that the controller wants is carried over every break.
#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <memory>
#include <vector>

#include <boost/numeric/odeint/algebra/array_algebra.hpp>
#include <boost/numeric/odeint/algebra/default_operations.hpp>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_runge_kutta_fehlberg78.hpp>
#include <boost/numeric/odeint/stepper/generation/make_controlled.hpp>

#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>

namespace odeint = boost::numeric::odeint;
namespace pin = pinocchio;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using State = std::array<double, 4>;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

enum { CONSTANT, HARMONIC, GAUSSIAN, RAMP, BURST, BUMP };
constexpr int TERM = 7;

extern "C" {
struct Tree {
    int joints, shapes;
    const int *parent;
    const double *turn, *place, *axis, *slide, *mass, *centre, *inertia, *matrix, *offset;
};

// Of terms, of polynomials (pieces, order, shapes), of a Fourier series (harmonics, shapes), or of the righting cat's
// three waist angles, bend, pitch and yaw (6, shapes), whichever is there.
struct Curve {
    int terms, order, pieces, harmonics;
    double frequency;           // of the first harmonic [rad/s]
    double duration, largest_bend;  // of the righting [s], [rad]
    const double *term, *knots, *series, *mean, *cosines, *sines, *righting;
};
}

struct Body {
    pin::Model model;
    std::unique_ptr<pin::Data> data;
    Eigen::VectorXd configuration, velocity, shape, rate;
    RowMajor matrix;
    Eigen::VectorXd offset;
    bool plain;
};

// A turning or sliding joint about or along an axis; those of the coordinate axes have cheaper code of their own.
template <class X, class Y, class Z, class Any>
static pin::JointModel aligned(const Vector3d &axis)
{
    if (axis == Vector3d::UnitX()) return X();
    if (axis == Vector3d::UnitY()) return Y();
    if (axis == Vector3d::UnitZ()) return Z();
    return Any(axis);
}

static Vector3d vector(const double *from, int k) { return Eigen::Map<const Vector3d>(from + 3 * k); }

static Matrix3d matrix(const double *from, int k)
{
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(from + 9 * k);
}

// With joints about their own axes z, x or y wherever a constant rotation of the frame would not be needed for it.
static Body *made(const Tree &tree)
{
    auto body = std::make_unique<Body>();
    auto &model = body->model;
    std::vector<pin::JointIndex> frames;
    frames.push_back(model.addJoint(0, pin::JointModelFreeFlyer(), pin::SE3::Identity(), "base"));
    for (int k = 0; k < tree.joints; k++) {
        const Vector3d axis = vector(tree.axis, k), slide = vector(tree.slide, k);
        if (!axis.isZero() && !slide.isZero()) return nullptr;  // a screw
        const pin::SE3 pose(matrix(tree.turn, k), vector(tree.place, k));
        const auto joint = slide.isZero()
            ? aligned<pin::JointModelRX, pin::JointModelRY, pin::JointModelRZ, pin::JointModelRevoluteUnaligned>(axis)
            : aligned<pin::JointModelPX, pin::JointModelPY, pin::JointModelPZ, pin::JointModelPrismaticUnaligned>(slide);
        frames.push_back(model.addJoint(frames[tree.parent[k]], joint, pose, "joint" + std::to_string(k)));
    }
    for (int k = 0; k <= tree.joints; k++)
        model.appendBodyToJoint(
            frames[k], pin::Inertia(tree.mass[k], vector(tree.centre, k), pin::Symmetric3(matrix(tree.inertia, k))),
            pin::SE3::Identity());
    body->data = std::make_unique<pin::Data>(model);
    body->configuration = pin::neutral(model);
    body->velocity = Eigen::VectorXd::Zero(model.nv);
    body->shape = body->rate = Eigen::VectorXd::Zero(tree.shapes);
    body->matrix = Eigen::Map<const RowMajor>(tree.matrix, tree.joints, tree.shapes);
    body->offset = Eigen::Map<const Eigen::VectorXd>(tree.offset, tree.joints);
    body->plain = tree.joints == tree.shapes && body->offset.isZero(0) && body->matrix.isIdentity(0);
    return body.release();
}

// Waist pitch, yaw and roll, bend, pitch and yaw of the cat that rights itself, and their rates.
static void right(const Curve &curve, double t, double *value, double *rate)
{
    const double pi = 3.14159265358979323846, x = t / curve.duration, x3 = x * x * x, y = 1 - x;
    const double s = x3 * x * (35 + x * (-84 + x * (70 - 20 * x))), ds = pi * 140 * x3 * y * y * y / curve.duration;
    const double bend = std::sin(pi * s), cosine = std::cos(pi * s), dbend = ds * cosine;
    const double ny = cosine * cosine - bend * bend, nz = -2 * bend * cosine, dny = 2 * ds * nz, dnz = -2 * ds * ny;
    const double gamma = curve.largest_bend * bend, dgamma = curve.largest_bend * dbend;
    const double c = std::cos(gamma), g = std::sin(gamma);
    const double a = c, da = -g * dgamma, b = nz * g, db = dnz * g + nz * c * dgamma, e = -ny * g,
                 de = -dny * g - ny * c * dgamma;
    const double upper = b * e, lower = a * (1 + a) + e * e;
    const double dupper = db * e + b * de, dlower = da * (1 + 2 * a) + 2 * e * de;
    const double values[] = {std::atan2(-e, a), std::asin(b), std::atan2(upper, lower), bend, bend * ny, bend * nz};
    const double rates[] = {
        (e * da - a * de) / (a * a + e * e), db / std::sqrt(1 - b * b),
        (dupper * lower - upper * dlower) / (upper * upper + lower * lower), dbend, dbend * ny + bend * dny,
        dbend * nz + bend * dnz};
    std::copy(values, values + 6, value);
    std::copy(rates, rates + 6, rate);
}

// Shapes and rates at time t, on the piece of that number.
static void follow(const Curve &curve, int piece, double t, Eigen::VectorXd &q, Eigen::VectorXd &v)
{
    const Eigen::Index n = q.size();
    using Row = Eigen::Map<const Eigen::VectorXd>;
    if (curve.harmonics) {
        const double angle = curve.frequency * t, first_sine = std::sin(angle), first_cosine = std::cos(angle);
        double sine = first_sine, cosine = first_cosine;
        q = Row(curve.mean, n);
        v.setZero();
        for (int k = 0; k < curve.harmonics; k++) {
            const Row a(curve.cosines + k * n, n), b(curve.sines + k * n, n);
            const double frequency = (k + 1) * curve.frequency;
            q.noalias() += cosine * a + sine * b;
            v.noalias() += (frequency * cosine) * b - (frequency * sine) * a;
            const double next = cosine * first_cosine - sine * first_sine;
            sine = sine * first_cosine + cosine * first_sine;
            cosine = next;
        }
    } else if (curve.order) {
        const double s = t - curve.knots[piece];
        const double *series = curve.series + static_cast<long>(piece) * curve.order * n;
        q = Row(series + (curve.order - 1) * n, n);
        v.setZero();
        for (int p = curve.order - 2; p >= 0; p--) {
            v = v * s + q;
            q = q * s + Row(series + p * n, n);
        }
    } else if (curve.righting) {
        double value[6], rate[6];
        right(curve, t, value, rate);
        q.setZero();
        v.setZero();
        for (int k = 0; k < 6; k++) {
            const Row weights(curve.righting + k * n, n);
            q.noalias() += value[k] * weights;
            v.noalias() += rate[k] * weights;
        }
    } else {
        q.setZero();
        v.setZero();
        for (int k = 0; k < curve.terms; k++) {
            const double *e = curve.term + TERM * k;
            const int i = static_cast<int>(e[1]);
            const double a = e[2], s = t - e[3], width = e[4], w = e[5], phase = e[6];
            switch (static_cast<int>(e[0])) {
            case CONSTANT: q[i] += a; break;
            case HARMONIC:
                q[i] += a * std::sin(w * s + phase);
                v[i] += a * w * std::cos(w * s + phase);
                break;
            case GAUSSIAN: {
                const double x = s / width, g = a * std::exp(-x * x);
                q[i] += g;
                v[i] -= 2 * x / width * g;
                break;
            }
            case RAMP: {
                const double x = std::tanh(s / width);
                q[i] += a * x;
                v[i] += a * (1 - x * x) / width;
                break;
            }
            case BURST: {
                const double x = s / width, g = a * std::exp(-x * x), sine = std::sin(w * s + phase);
                q[i] += g * sine;
                v[i] += g * (w * std::cos(w * s + phase) - 2 * x / width * sine);
                break;
            }
            case BUMP: {
                const double x = s / width, d = 1 - x * x;
                if (d <= 0) break;
                const double g = a * std::exp(1 - 1 / d);
                q[i] += g;
                v[i] -= g * 2 * x / (d * d * width);
                break;
            }
            }
        }
    }
}

// The rate of the quaternion x y z w, whose length the formulas divide out.
struct Slope {
    Body &body;
    const Curve &curve;
    Vector3d momentum;
    int piece = 0;
    long evaluations = 0;

    void operator()(const State &state, State &rate, double t)
    {
        evaluations++;
        auto &data = *body.data;
        follow(curve, piece, t, body.shape, body.rate);
        if (body.plain) {
            body.configuration.tail(body.shape.size()) = body.shape;
            body.velocity.tail(body.shape.size()) = body.rate;
        } else {
            const Eigen::Index joints = body.offset.size();
            body.configuration.tail(joints).noalias() = body.matrix * body.shape + body.offset;
            body.velocity.tail(joints).noalias() = body.matrix * body.rate;
        }
        pin::ccrba(body.model, data, body.configuration, body.velocity);
        const Eigen::Quaterniond attitude = Eigen::Quaterniond(state[3], state[0], state[1], state[2]).normalized();
        const Vector3d seen = attitude.conjugate() * momentum;
        const Matrix3d inertia = data.Ig.inertia().matrix();
        const Vector3d half = 0.5 * (inertia.inverse() * (seen - data.hg.angular()));
        const double x = state[0], y = state[1], z = state[2], w = state[3];
        rate[0] = w * half[0] + y * half[2] - z * half[1];
        rate[1] = w * half[1] + z * half[0] - x * half[2];
        rate[2] = w * half[2] + x * half[1] - y * half[0];
        rate[3] = -x * half[0] - y * half[1] - z * half[2];
    }
};

// From the identity through all breaks; `record(time, state)` after every step. Returns whether steps stayed long enough.
template <class Record>
static bool integrate(Slope &slope, int breaks, const double *edge, double relative, double absolute, Record record)
{
    using Stepper = odeint::runge_kutta_fehlberg78<State, double, State, double, odeint::array_algebra>;
    auto stepper = odeint::make_controlled(absolute, relative, Stepper());
    const double duration = edge[breaks - 1] - edge[0];
    State state = {0, 0, 0, 1};
    double t = edge[0], wanted = 0.01 * duration;
    for (slope.piece = 0; slope.piece + 1 < breaks; slope.piece++) {
        const double end = edge[slope.piece + 1];
        while (t < end) {
            const bool last = t + wanted * (1 + 1e-9) >= end;
            const double start = t, tried = last ? end - t : wanted;
            double step = tried;
            const auto outcome = stepper.try_step(std::ref(slope), state, t, step);
            if (outcome == odeint::fail) {
                if (!(step > 1e-13 * duration)) return false;
                wanted = step;
                continue;
            }
            // A step that was cut short by a break says nothing against the one wanted before.
            wanted = last ? std::max(wanted, step) : step;
            t = last ? end : start + tried;
            record(t, state);
        }
        double norm = 0;
        for (double x : state) norm += x * x;
        for (double &x : state) x /= std::sqrt(norm);
    }
    return true;
}

extern "C" {
void *peer_body(const Tree *tree) { return made(*tree); }

void peer_forget(void *body) { delete static_cast<Body *>(body); }

// Times and quaternions after every step, as many as fit; returns how many there are, or -1 where steps became too short.
long peer_steps(void *body, const Curve *curve, int breaks, const double *edge, const double *momentum, double relative,
                double absolute, long most, double *times, double *quaternions, long *evaluations)
{
    Slope slope{*static_cast<Body *>(body), *curve, Vector3d(momentum[0], momentum[1], momentum[2])};
    long count = 0;
    const bool done = integrate(slope, breaks, edge, relative, absolute, [&](double t, const State &state) {
        if (count < most) {
            times[count] = t;
            std::copy(state.begin(), state.end(), quaternions + 4 * count);
        }
        count++;
    });
    *evaluations = slope.evaluations;
    return done ? count : -1;
}

// The processor time of this thread for `runs` integrations that keep only the last attitude [s].
double peer_seconds(void *body, const Curve *curve, int breaks, const double *edge, const double *momentum, double relative,
                    double absolute, int runs, double *quaternion)
{
    timespec began, ended;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &began);
    for (int run = 0; run < runs; run++) {
        Slope slope{*static_cast<Body *>(body), *curve, Vector3d(momentum[0], momentum[1], momentum[2])};
        integrate(slope, breaks, edge, relative, absolute, [&](double, const State &state) {
            std::copy(state.begin(), state.end(), quaternion);
        });
    }
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &ended);
    return double(ended.tv_sec - began.tv_sec) + 1e-9 * double(ended.tv_nsec - began.tv_nsec);
}
}
