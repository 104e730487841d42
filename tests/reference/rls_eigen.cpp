// Compares regressor + RLS with two independent solutions in double: the textbook recursion on a full covariance matrix
// and a batch QR, both with Eigen, on a simulated loop with two inputs and three outputs.
#include "aeolid/markov.h"
#include "aeolid/regressor.h"
#include "aeolid/rls.h"

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

namespace
{

constexpr int R = 2, L = 3, P = 10, M = R + L, N = P * M, SAMPLES = 3000;

struct Data {
    Eigen::MatrixXd u{R, SAMPLES}, y{L, SAMPLES};
};

// A stable third-order plant with process noise under feedback u = r - F y of the sample before.
Data simulate(unsigned seed)
{
    std::mt19937_64 bits(seed);
    auto draw = [&bits] { return static_cast<double>(bits() >> 11) / 9007199254740992.0 - 0.5; };
    Eigen::Matrix3d a;
    a << 0.9, 0.2, 0.0, -0.2, 0.9, 0.1, 0.0, 0.0, 0.5;
    Eigen::Matrix<double, 3, R> b;
    b << 1.0, 0.0, 0.3, 0.5, 0.0, 1.0;
    Eigen::Matrix<double, R, L> f;
    f << 0.1, 0.0, 0.05, 0.0, 0.1, 0.0;
    Eigen::Vector3d x = Eigen::Vector3d::Zero(), y = x;
    Data data;
    for (int k = 0; k < SAMPLES; k++) {
        const Eigen::Vector2d r(draw(), draw());
        const Eigen::Vector2d u = r - f * y;
        y = x + 0.1 * Eigen::Vector3d(draw(), draw(), draw());
        data.u.col(k) = u;
        data.y.col(k) = y;
        x = a * x + b * u + 0.1 * Eigen::Vector3d(draw(), draw(), draw());
    }
    return data;
}

Eigen::VectorXd regressor_of(const Data &data, int k)
{
    Eigen::VectorXd z(N);
    for (int i = 0; i < P; i++) {
        z.segment(i * M, R) = data.u.col(k - P + i);
        z.segment(i * M + R, L) = data.y.col(k - P + i);
    }
    return z;
}

Eigen::MatrixXd solve_recursively(const Data &data, double lambda, double rho)
{
    Eigen::MatrixXd p = Eigen::MatrixXd::Identity(N, N) / rho, theta = Eigen::MatrixXd::Zero(L, N);
    for (int k = P; k < SAMPLES; k++) {
        const Eigen::VectorXd z = regressor_of(data, k), pz = p * z;
        const Eigen::VectorXd gain = pz / (lambda + z.dot(pz));
        theta += (data.y.col(k) - theta * z) * gain.transpose();
        p = (p - gain * pz.transpose()) / lambda;
        // Without this line P loses its symmetry and the textbook form is 1e-3 off at lambda = 0.99, in double.
        p = (0.5 * (p + p.transpose())).eval();
    }
    return theta;
}

Eigen::MatrixXd solve_batch(const Data &data, double lambda, double rho)
{
    const int count = SAMPLES - P;
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(N + count, N), b = Eigen::MatrixXd::Zero(N + count, L);
    a.topRows(N).diagonal().setConstant(std::sqrt(rho * std::pow(lambda, count)));
    for (int k = P; k < SAMPLES; k++) {
        const double weight = std::sqrt(std::pow(lambda, SAMPLES - 1 - k));
        a.row(N + k - P) = weight * regressor_of(data, k).transpose();
        b.row(N + k - P) = weight * data.y.col(k).transpose();
    }
    return a.householderQr().solve(b).transpose();
}

Eigen::MatrixXd solve_with_library(const Data &data, double lambda, double rho)
{
    std::vector<aeo_real_t> window(AEO_REGRESSOR_WORDS(R, L, P, 0)), words(AEO_RLS_WORDS(N, L));
    aeo_regressor_config_t layout{};
    layout.inputs = R;
    layout.outputs = L;
    layout.past = P;
    layout.period_us = 1;
    const aeo_rls_config_t settings = {N, L, static_cast<aeo_real_t>(lambda), static_cast<aeo_real_t>(rho), 0, 1e6f};
    aeo_regressor_t regressor;
    aeo_rls_t rls;
    if (aeo_regressor_init(&regressor, &layout, window.data(), window.size()) != AEO_OK ||
        aeo_rls_init(&rls, &settings, words.data(), words.size()) != AEO_OK) {
        return Eigen::MatrixXd::Zero(L, N);
    }
    for (int k = 0; k < SAMPLES; k++) {
        aeo_real_t u[R], y[L];
        for (int i = 0; i < R; i++) {
            u[i] = static_cast<aeo_real_t>(data.u(i, k));
        }
        for (int i = 0; i < L; i++) {
            y[i] = static_cast<aeo_real_t>(data.y(i, k));
        }
        if (aeo_regressor_push(&regressor, u, y, static_cast<uint64_t>(k)) == AEO_OK) {
            aeo_rls_update(&rls, aeo_regressor_z(&regressor), aeo_regressor_y(&regressor));
        }
    }
    Eigen::MatrixXd theta(L, N);
    for (int i = 0; i < L * N; i++) {
        theta(i / N, i % N) = static_cast<double>(aeo_rls_theta(&rls)[i]);
    }
    return theta;
}

} // namespace

int main()
{
    // Rounding of the samples and settings to float alone moves the answer by their condition times 6e-8.
    const double bound = sizeof(aeo_real_t) == 4 ? 1e-3 : 1e-10;
    bool good = true;
    for (unsigned seed = 1; seed <= 3; seed++) {
        for (const double lambda : {1.0, 0.999, 0.99}) {
            const double rounded = static_cast<double>(static_cast<aeo_real_t>(lambda));
            const Data data = simulate(seed);
            const Eigen::MatrixXd ours = solve_with_library(data, lambda, 1.0);
            const Eigen::MatrixXd batch = solve_batch(data, rounded, 1.0),
                                  textbook = solve_recursively(data, rounded, 1.0);
            const double to_batch = (ours - batch).norm() / batch.norm(),
                         to_text = (ours - textbook).norm() / batch.norm();
            std::printf("seed %u lambda %.3f: %.1e from batch QR, %.1e from the textbook recursion\n", seed, lambda,
                        to_batch, to_text);
            good = good && to_batch < bound && to_text < bound;
        }
    }
    return good ? 0 : 1;
}
