// Compares the fast filter with two independent solutions in double: a batch QR, and the textbook recursion on a full
// covariance matrix, both with Eigen, on a simulated loop with two inputs and three outputs. The window slides in from
// zeros, so that all three start from the same; a second pass starts within the record and is compared after 20 memories.
#include "aeolid/fast_rls.h"

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

namespace
{

constexpr int R = 2, L = 3, P = 8, M = R + L, SAMPLES = 3000;

// A stable third-order plant with process noise under feedback u = r - F y of the sample before. Rows u, y.
Eigen::MatrixXd simulate(unsigned seed)
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
    Eigen::MatrixXd data(M, SAMPLES);
    for (int k = 0; k < SAMPLES; k++) {
        const Eigen::Vector2d r(draw(), draw());
        const Eigen::Vector2d u = r - f * y;
        y = x + 0.1 * Eigen::Vector3d(draw(), draw(), draw());
        data.block<R, 1>(0, k) = u;
        data.block<L, 1>(R, k) = y;
        x = a * x + b * u + 0.1 * Eigen::Vector3d(draw(), draw(), draw());
    }
    return data;
}

// The regressors, one a row: P blocks, oldest first, zeros before the record, then the present inputs of the mask.
Eigen::MatrixXd slide(const Eigen::MatrixXd &data, unsigned mask)
{
    const int present = static_cast<int>((mask & 1u) + (mask >> 1 & 1u));
    Eigen::MatrixXd z = Eigen::MatrixXd::Zero(SAMPLES, P * M + present);
    for (int k = 0; k < SAMPLES; k++) {
        for (int i = k < P ? P - k : 0; i < P; i++) {
            z.row(k).segment(i * M, M) = data.col(k - P + i).transpose();
        }
        int tail = P * M;
        for (int i = 0; i < R; i++) {
            if ((mask >> i & 1u) != 0u) {
                z(k, tail++) = data(i, k);
            }
        }
    }
    return z;
}

// 1 / P_-1 as the header has it.
Eigen::VectorXd prior(Eigen::Index n, double lambda, double rho)
{
    Eigen::VectorXd weight(n);
    for (Eigen::Index j = 0; j < n; j++) {
        weight(j) = rho * std::pow(lambda, static_cast<double>(j / M) + 1 - P);
    }
    return weight;
}

Eigen::MatrixXd solve_recursively(const Eigen::MatrixXd &z, const Eigen::MatrixXd &y, double lambda, double rho)
{
    const Eigen::Index n = z.cols();
    Eigen::MatrixXd p = prior(n, lambda, rho).cwiseInverse().asDiagonal(), theta = Eigen::MatrixXd::Zero(L, n);
    for (int k = 0; k < SAMPLES; k++) {
        const Eigen::VectorXd w = z.row(k).transpose(), pw = p * w;
        const Eigen::VectorXd gain = pw / (lambda + w.dot(pw));
        theta += (y.col(k) - theta * w) * gain.transpose();
        p = (p - gain * pw.transpose()) / lambda;
        p = (0.5 * (p + p.transpose())).eval(); // or P loses its symmetry
    }
    return theta;
}

Eigen::MatrixXd solve_batch(const Eigen::MatrixXd &z, const Eigen::MatrixXd &y, double lambda, double rho)
{
    const Eigen::Index n = z.cols();
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n + SAMPLES, n), b = Eigen::MatrixXd::Zero(n + SAMPLES, L);
    a.topRows(n).diagonal() = (prior(n, lambda, rho) * std::pow(lambda, SAMPLES)).cwiseSqrt();
    for (int k = 0; k < SAMPLES; k++) {
        const double weight = std::sqrt(std::pow(lambda, SAMPLES - 1 - k));
        a.row(n + k) = weight * z.row(k);
        b.row(n + k) = weight * y.col(k).transpose();
    }
    return a.householderQr().solve(b).transpose();
}

Eigen::MatrixXd solve_with_library(const Eigen::MatrixXd &z, const Eigen::MatrixXd &y, unsigned mask, double lambda,
                                   double rho, int from)
{
    const int n = static_cast<int>(z.cols());
    std::vector<aeo_real_t> words(AEO_FAST_RLS_WORDS(P, M, n - P * M, L));
    aeo_fast_rls_config_t settings{};
    settings.past = P;
    settings.block = M;
    settings.outputs = L;
    settings.feedthrough = mask;
    settings.forgetting = static_cast<aeo_real_t>(lambda);
    settings.regularisation = static_cast<aeo_real_t>(rho);
    settings.growth_max = static_cast<aeo_real_t>(1e6);
    aeo_fast_rls_t fast;
    Eigen::MatrixXd theta = Eigen::MatrixXd::Zero(L, n);
    if (aeo_fast_rls_init(&fast, &settings, words.data(), words.size()) != AEO_OK) {
        return theta;
    }
    for (int k = from; k < SAMPLES; k++) {
        std::vector<aeo_real_t> w(static_cast<size_t>(n));
        aeo_real_t out[L];
        for (int j = 0; j < n; j++) {
            w[static_cast<size_t>(j)] = static_cast<aeo_real_t>(z(k, j));
        }
        for (int i = 0; i < L; i++) {
            out[i] = static_cast<aeo_real_t>(y(i, k));
        }
        aeo_fast_rls_update(&fast, w.data(), out);
    }
    for (int i = 0; i < L * n; i++) {
        theta(i / n, i % n) = static_cast<double>(aeo_fast_rls_theta(&fast)[i]);
    }
    return theta;
}

} // namespace

int main()
{
    // Rounding of the samples and settings to float alone moves the answer by their condition times 6e-8.
    const double bound = sizeof(aeo_real_t) == 4 ? 1e-3 : 1e-10;
    bool good = true;
    for (unsigned mask = 0; mask < 4; mask++) {
        const Eigen::MatrixXd data = simulate(mask + 1), z = slide(data, mask), y = data.bottomRows(L);
        for (const double lambda : {1.0, 0.999, 0.998}) {
            const double rounded = static_cast<double>(static_cast<aeo_real_t>(lambda));
            const Eigen::MatrixXd ours = solve_with_library(z, y, mask, lambda, 1.0, 0);
            const Eigen::MatrixXd batch = solve_batch(z, y, rounded, 1.0),
                                  textbook = solve_recursively(z, y, rounded, 1.0);
            const double to_batch = (ours - batch).norm() / batch.norm(),
                         to_text = (ours - textbook).norm() / batch.norm();
            std::printf("mask %u lambda %.3f: %.1e from batch QR, %.1e from the textbook recursion\n", mask, lambda,
                        to_batch, to_text);
            good = good && to_batch < bound && to_text < bound;
        }
        const double lambda = static_cast<double>(static_cast<aeo_real_t>(0.99)); // memory 100: e^-28 of the start left
        const Eigen::MatrixXd late = solve_with_library(z, y, mask, lambda, 1.0, 200);
        const Eigen::MatrixXd batch = solve_batch(z, y, lambda, 1.0);
        const double apart = (late - batch).norm() / batch.norm();
        std::printf("mask %u lambda 0.990, started within the record: %.1e from batch QR\n", mask, apart);
        // n = 40 ... 42 for a memory of 100: arrays are renewed, each with e^-7 (float), e^-14 (double) of its start left.
        good = good && apart < (sizeof(aeo_real_t) == 4 ? 1e-2 : 1e-4);
    }
    return good ? 0 : 1;
}
