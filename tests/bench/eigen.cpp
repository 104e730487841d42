// eigen.cpp: the textbook RLS with Eigen, as its users write it.
#include "rivals.h"

#include <Eigen/Dense>

namespace
{
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

namespace
{
using map_t = Eigen::Map<const vector_t>;

/* g = P z. Forms that keep the lower triangle only take the other half from it. */
void find_gain(const map_t &z, int form)
{
    if (form < EIGEN_TRIANGULAR) {
        g.noalias() = p * z;
    } else {
        g.noalias() = p.selfadjointView<Eigen::Lower>() * z;
    }
}

/* P = (P - scaled g') / lambda */
void move_covariance(int form)
{
    const aeo_real_t inverse = aeo_real_t(1) / lambda;
    switch (form) {
    case EIGEN_EXPRESSION:
        p = inverse * (p - scaled * g.transpose());
        break;
    case EIGEN_IN_PLACE:
        p.noalias() -= scaled * g.transpose();
        p *= inverse;
        break;
    case EIGEN_LAZY:
        p = inverse * (p - scaled.lazyProduct(g.transpose()));
        break;
    case EIGEN_TRIANGULAR:
        p.triangularView<Eigen::Lower>() = inverse * (p - scaled.lazyProduct(g.transpose()));
        break;
    default: /* column after column of the lower triangle, each in one expression: what a careful user writes */
        scaled *= inverse;
        for (Eigen::Index j = 0; j < p.cols(); j++) {
            const Eigen::Index below = p.rows() - j;
            p.col(j).tail(below) = inverse * p.col(j).tail(below) - g[j] * scaled.tail(below);
        }
    }
}
} // namespace

void eigen_update(const aeo_real_t *z_values, const aeo_real_t *y_values, int form)
{
    const map_t z(z_values, p.rows()), y(y_values, theta.rows());
    find_gain(z, form);
    scaled = g / (lambda + z.dot(g));
    eps = y;
    eps.noalias() -= theta * z;
    theta.noalias() += eps * scaled.transpose();
    move_covariance(form);
}

const aeo_real_t *eigen_theta(void)
{
    return theta.data();
}
