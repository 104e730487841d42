// eigen.cpp: the textbook RLS with Eigen, as its users write it.
#include "rivals.h"

#include <Eigen/Dense>

namespace {
using matrix_t = Eigen::Matrix<aeo_real_t, Eigen::Dynamic, Eigen::Dynamic>;
using vector_t = Eigen::Matrix<aeo_real_t, Eigen::Dynamic, 1>;

matrix_t p, theta;
vector_t g, scaled, eps;
aeo_real_t lambda;
} // namespace

void eigen_start(size_t n, size_t l, aeo_real_t forgetting, aeo_real_t rho)
{
    const auto rows = static_cast<Eigen::Index>(n), outputs = static_cast<Eigen::Index>(l);
    lambda = forgetting;
    p = matrix_t::Identity(rows, rows) / rho;
    theta = matrix_t::Zero(outputs, rows);
    g.resize(rows);
    scaled.resize(rows);
    eps.resize(outputs);
}

void eigen_update(const aeo_real_t *z_values, const aeo_real_t *y_values, int form)
{
    const Eigen::Map<const vector_t> z(z_values, p.rows()), y(y_values, theta.rows());
    g.noalias() = p * z;
    scaled = g / (lambda + z.dot(g));
    eps = y;
    eps.noalias() -= theta * z;
    theta.noalias() += eps * scaled.transpose();
    const aeo_real_t inverse = aeo_real_t(1) / lambda;
    if (form == 0) {
        p = inverse * (p - scaled * g.transpose());
    } else {
        p.noalias() -= scaled * g.transpose();
        p *= inverse;
    }
}

const aeo_real_t *eigen_theta(void)
{
    return theta.data();
}
