// Compares regressor + lattice with independent solutions in double with Eigen, on a simulated loop with two inputs and
// three outputs, one of which passes through at once: a batch QR of every sample from rest, after each of several
// hundred samples; and, where the record does not begin at rest, the batch QR of the samples behind the start.
#include "aeolid/lattice.h"
#include "aeolid/regressor.h"

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

namespace
{

constexpr int R = 2, L = 3, M = R + L, D = 1, SAMPLES = 3000;

struct Data {
    Eigen::MatrixXd u{R, SAMPLES}, y{L, SAMPLES};
};

// A stable third-order plant with process noise under feedback u = r - F y of the sample before; the first input acts
// on the second output within the sample.
Data simulate(unsigned seed, double start)
{
    std::mt19937_64 bits(seed);
    auto draw = [&bits] { return static_cast<double>(bits() >> 11) / 9007199254740992.0 - 0.5; };
    Eigen::Matrix3d a;
    a << 0.9, 0.2, 0.0, -0.2, 0.9, 0.1, 0.0, 0.0, 0.5;
    Eigen::Matrix<double, 3, R> b, through;
    b << 1.0, 0.0, 0.3, 0.5, 0.0, 1.0;
    through << 0.0, 0.0, 0.7, 0.0, 0.0, 0.0;
    Eigen::Matrix<double, R, L> f;
    f << 0.1, 0.0, 0.05, 0.0, 0.1, 0.0;
    Eigen::Vector3d x = Eigen::Vector3d::Constant(start), y = x;
    Data data;
    for (int k = 0; k < SAMPLES; k++) {
        const Eigen::Vector2d r(draw(), draw());
        const Eigen::Vector2d u = r - f * y;
        y = x + through * u + 0.1 * Eigen::Vector3d(draw(), draw(), draw());
        data.u.col(k) = u;
        data.y.col(k) = y;
        x = a * x + b * u + 0.1 * Eigen::Vector3d(draw(), draw(), draw());
    }
    return data;
}

// Rounded as the library sees them, so that the comparison is of recursions.
Data round_samples(Data data)
{
    data.u = data.u.cast<aeo_real_t>().cast<double>();
    data.y = data.y.cast<aeo_real_t>().cast<double>();
    return data;
}

Eigen::VectorXd regressor_of(const Data &data, int k, int p)
{
    Eigen::VectorXd z = Eigen::VectorXd::Zero(p * M + D);
    for (int i = std::max(0, p - k); i < p; i++) {
        z.segment(i * M, R) = data.u.col(k - p + i);
        z.segment(i * M + R, L) = data.y.col(k - p + i);
    }
    z.tail(D) = data.u.col(k).head(D);
    return z;
}

// Samples first ... last-1; the prior of a block weighs lambda^-age that of the newest.
Eigen::MatrixXd solve_batch(const Data &data, int p, double lambda, double rho, int first, int last)
{
    const int n = p * M + D, count = last - first;
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n + count, n), b = Eigen::MatrixXd::Zero(n + count, L);
    for (int j = 0; j < n; j++) {
        const int age = j < p * M ? p - 1 - j / M : 0;
        a(j, j) = std::sqrt(rho * std::pow(lambda, count - age));
    }
    for (int k = first; k < last; k++) {
        const double weight = std::sqrt(std::pow(lambda, last - 1 - k));
        a.row(n + k - first) = weight * regressor_of(data, k, p).transpose();
        b.row(n + k - first) = weight * data.y.col(k).transpose();
    }
    return a.householderQr().solve(b).transpose();
}

class Filter
{
  public:
    Filter(int p, double lambda, double rho)
        : past(p), memory(AEO_LATTICE_WORDS(static_cast<size_t>(p), M, D, L)),
          window(AEO_REGRESSOR_WORDS(R, L, static_cast<size_t>(p), 0))
    {
        const aeo_lattice_config_t settings = {
            static_cast<uint16_t>(p),    M, D, L, static_cast<aeo_real_t>(lambda), static_cast<aeo_real_t>(rho), 0,
            static_cast<aeo_real_t>(1e6)};
        aeo_regressor_config_t layout{};
        layout.inputs = R;
        layout.outputs = L;
        layout.past = static_cast<uint16_t>(p);
        layout.feedthrough = 1;
        layout.period_us = 1;
        sound = aeo_lattice_init(&lattice, &settings, memory.data(), memory.size()) == AEO_OK &&
                aeo_regressor_init(&regressor, &layout, window.data(), window.size()) == AEO_OK;
    }
    Filter(const Filter &) = delete;
    Filter &operator=(const Filter &) = delete;

    void push(const Data &data, int k)
    {
        aeo_real_t u[R], y[L];
        for (int i = 0; i < R; i++) {
            u[i] = static_cast<aeo_real_t>(data.u(i, k));
        }
        for (int i = 0; i < L; i++) {
            y[i] = static_cast<aeo_real_t>(data.y(i, k));
        }
        if (aeo_regressor_push(&regressor, u, y, static_cast<uint64_t>(k)) == AEO_OK) {
            sound = aeo_lattice_update(&lattice, aeo_regressor_z(&regressor), aeo_regressor_y(&regressor)) == AEO_OK &&
                    aeo_lattice_invariants_hold(&lattice) && sound;
        }
    }

    // The same without the regressor, whose first window is a full one: from rest, zeros before the first sample.
    void push_from_rest(const Data &data, int k)
    {
        const Eigen::Matrix<aeo_real_t, Eigen::Dynamic, 1> z = regressor_of(data, k, past).cast<aeo_real_t>();
        const Eigen::Matrix<aeo_real_t, L, 1> y = data.y.col(k).cast<aeo_real_t>();
        sound = aeo_lattice_update(&lattice, z.data(), y.data()) == AEO_OK && sound;
    }

    Eigen::MatrixXd theta()
    {
        Eigen::Matrix<aeo_real_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> out(L, past * M + D);
        sound = aeo_lattice_read(&lattice, out.data(), static_cast<size_t>(out.size())) == AEO_OK && sound;
        return out.cast<double>();
    }

    bool sound = false;

  private:
    int past;
    std::vector<aeo_real_t> memory, window;
    aeo_lattice_t lattice;
    aeo_regressor_t regressor;
};

double distance(const Eigen::MatrixXd &a, const Eigen::MatrixXd &b)
{
    return (a - b).norm() / b.norm();
}

// From rest the lattice minimises its sum exactly, whatever the sample at which it is read.
bool compare_from_rest(double bound)
{
    bool good = true;
    for (const int p : {1, 4, 10}) {
        for (const double lambda : {1.0, 0.999, 0.98}) {
            const double rounded = static_cast<double>(static_cast<aeo_real_t>(lambda));
            const Data data = round_samples(simulate(static_cast<unsigned>(p), 0.0));
            Filter filter(p, lambda, 0.5);
            double worst = 0.0;
            for (int k = 0; k < 600; k++) {
                filter.push_from_rest(data, k);
                if (k > 0 && (k < 40 || k % 50 == 0)) {
                    worst = std::max(worst, distance(filter.theta(), solve_batch(data, p, rounded, 0.5, 0, k + 1)));
                }
            }
            std::printf("from rest, p %d lambda %.3f: at most %.1e from batch QR\n", p, lambda, worst);
            good = good && filter.sound && worst < bound;
        }
    }
    return good;
}

// A record cut out of a longer one: what is left of its edge after 3000 samples lies within the spread of the estimate,
// which a second record of the same plant shows.
bool compare_from_anywhere()
{
    bool good = true;
    for (const double lambda : {1.0, 0.999}) {
        const int p = 10;
        const Data data = simulate(5, 3.0), twin = simulate(6, 3.0);
        Filter filter(p, lambda, 0.5);
        for (int k = 0; k < SAMPLES; k++) {
            filter.push(data, k);
        }
        const Eigen::MatrixXd batch = solve_batch(data, p, lambda, 0.5, p, SAMPLES);
        const double edge = distance(filter.theta(), batch),
                     spread = distance(solve_batch(twin, p, lambda, 0.5, p, SAMPLES), batch);
        std::printf("from anywhere, lambda %.3f: %.1e from batch QR, another record %.1e\n", lambda, edge, spread);
        good = good && filter.sound && edge < 0.5 * spread;
    }
    return good;
}

} // namespace

int main()
{
    // The samples are the same to the bit, so rounding of the recursion alone is left: some ten of them.
    const double bound = sizeof(aeo_real_t) == 4 ? 1e-5 : 1e-13;
    const bool exact = compare_from_rest(bound), anywhere = compare_from_anywhere();
    return exact && anywhere ? 0 : 1;
}
