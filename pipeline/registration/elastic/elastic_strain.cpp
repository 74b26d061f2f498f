// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/elastic/elastic_strain.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline registration_elastic {

double natural_log(double x) {
    int exponent = 0;
    double m = std::frexp(x, &exponent);  // exact
    if (m < 0.70710678118654752) {
        m *= 2;
        --exponent;
    }
    // log m = 2 artanh s with |s| <= 0.172: the next term is below 1e-17.
    const double s = (m - 1) / (m + 1), t = s * s;
    double sum = 1.0 / 21;
    for (int n = 19; n >= 3; n -= 2) sum = sum * t + 1.0 / n;
    return exponent * 0.69314718055994531 + 2 * s * (1 + t * sum);
}

namespace {

constexpr std::size_t kBlock = 512;  // samples whose energies are summed together

// Columns of a matrix.
struct Square {
    double m[3][3];  // [column][row]
};

Square cofactors(const Square& f) {
    Square k;
    for (int c = 0; c < 3; ++c) {
        const double *a = f.m[(c + 1) % 3], *b = f.m[(c + 2) % 3];
        k.m[c][0] = a[1] * b[2] - a[2] * b[1];
        k.m[c][1] = a[2] * b[0] - a[0] * b[2];
        k.m[c][2] = a[0] * b[1] - a[1] * b[0];
    }
    return k;
}

double determinant_of(const Square& f, const Square& k) {
    return f.m[0][0] * k.m[0][0] + f.m[0][1] * k.m[0][1] + f.m[0][2] * k.m[0][2];
}

// The nearest rotation, by Newton's method X <- (X + X^-T) / 2; det F > 0.
Square polar_rotation(const Square& f, const Square& k, double det) {
    Square x = f, cof = k;
    for (int n = 0; n < 20; ++n) {
        const double half = 0.5 / det;
        double change = 0;
        for (int c = 0; c < 3; ++c) {
            for (int r = 0; r < 3; ++r) {
                const double next = 0.5 * x.m[c][r] + half * cof.m[c][r];
                change += (next - x.m[c][r]) * (next - x.m[c][r]);
                x.m[c][r] = next;
            }
        }
        if (change < 1e-10) break;  // the error is then below the square of that
        cof = cofactors(x);
        det = determinant_of(x, cof);
    }
    return x;
}

struct Sample {
    Square f, cof, rotation;
    double det = 0, log_det = 0, log_barrier = 0;  // the latter 0 above d0
};

Sample sample_of(const Square& f, double barrier_det) {
    Sample s;
    s.f = f;
    s.cof = cofactors(f);
    s.det = determinant_of(f, s.cof);
    if (!(s.det > 0)) return s;
    s.rotation = polar_rotation(f, s.cof, s.det);
    s.log_det = natural_log(s.det);
    if (s.det < barrier_det) s.log_barrier = s.log_det - natural_log(barrier_det);
    return s;
}

double energy_of(const Sample& s, double mu, double kappa, double beta) {
    double shape = 0;
    for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 3; ++r) {
            const double d = s.f.m[c][r] - s.rotation.m[c][r];
            shape += d * d;
        }
    }
    return mu * shape + kappa * s.log_det * s.log_det + beta * s.log_barrier * s.log_barrier;
}

Lanes lanes_of(const double* v, double scale) {
    return Lanes{static_cast<float>(scale * v[0]), static_cast<float>(scale * v[1]),
                 static_cast<float>(scale * v[2]), 0};
}

}  // namespace

ElasticStrain::ElasticStrain(const SplineLattice& lattice,
                             const QuadraticMap& quadratic,
                             TissueLattice tissue)
    : lattice_(lattice), tissue_(std::move(tissue)) {
    const Int3 n = lattice.size();
    for (int k = 0; k < n.z; ++k) {
        for (int j = 0; j < n.y; ++j) {
            for (int i = 0; i < n.x; ++i) {
                const Matrix3 m = jacobian(quadratic, lattice.place(i, j, k));
                const auto column = [&](int c) {
                    const double v[3] = {m(0, c), m(1, c), m(2, c)};
                    return lanes_of(v, 1);
                };
                base_.push_back({column(0), column(1), column(2)});
            }
        }
    }
    cofactor_.resize(base_.size());
    shape_.resize(base_.size());
}

ElasticStrain::Value ElasticStrain::value(const LatticeSlopes& at,
                                          const LatticeSlopes& along,
                                          double step,
                                          const StrainOptions& options) const {
    const double share = 1 / tissue_.inside;
    const std::size_t count = base_.size();
    std::vector<Value> parts((count + kBlock - 1) / kBlock);
    parallel_for(parts.size(), 1, [&](std::size_t first, std::size_t last) {
        for (std::size_t p = first; p < last; ++p) {
            Value v{0, std::numeric_limits<double>::infinity()};
            for (std::size_t i = p * kBlock; i < std::min(count, (p + 1) * kBlock); ++i) {
                Square f;
                for (int r = 0; r < 3; ++r) {
                    f.m[0][r] = static_cast<double>(base_[i].x[r] + at.x[i][r]) +
                                step * static_cast<double>(along.x[i][r]);
                    f.m[1][r] = static_cast<double>(base_[i].y[r] + at.y[i][r]) +
                                step * static_cast<double>(along.y[i][r]);
                    f.m[2][r] = static_cast<double>(base_[i].z[r] + at.z[i][r]) +
                                step * static_cast<double>(along.z[i][r]);
                }
                const Sample s = sample_of(f, options.barrier_det);
                v.min_det = std::min(v.min_det, s.det);
                if (!(s.det > 0)) continue;
                v.energy_mm2 +=
                    share * energy_of(s, options.stiffness * static_cast<double>(tissue_.shape[i]),
                                      options.stiffness * static_cast<double>(tissue_.volume[i]),
                                      options.barrier);
            }
            parts[p] = v;
        }
    });
    Value whole{0, std::numeric_limits<double>::infinity()};
    for (const Value& v : parts) {
        whole.energy_mm2 += v.energy_mm2;
        whole.min_det = std::min(whole.min_det, v.min_det);
    }
    return whole;
}

void ElasticStrain::linearise(const LatticeSlopes& at,
                              const StrainOptions& options,
                              LatticeSlopes* gradient) {
    const double share = 1 / tissue_.inside;
    gradient->resize(base_.size());
    parallel_for(base_.size(), kBlock, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            Square f;
            for (int r = 0; r < 3; ++r) {
                f.m[0][r] = static_cast<double>(base_[i].x[r] + at.x[i][r]);
                f.m[1][r] = static_cast<double>(base_[i].y[r] + at.y[i][r]);
                f.m[2][r] = static_cast<double>(base_[i].z[r] + at.z[i][r]);
            }
            const Sample s = sample_of(f, options.barrier_det);
            const double mu = share * options.stiffness * static_cast<double>(tissue_.shape[i]);
            const double kappa = share * options.stiffness * static_cast<double>(tissue_.volume[i]);
            const double beta = s.det < options.barrier_det ? share * options.barrier : 0;
            const double slope = (kappa * s.log_det + beta * s.log_barrier) / s.det;
            const double root = std::sqrt(kappa + beta) / s.det;
            double g[3][3];
            for (int c = 0; c < 3; ++c) {
                for (int r = 0; r < 3; ++r) {
                    g[c][r] = mu * (s.f.m[c][r] - s.rotation.m[c][r]) + slope * s.cof.m[c][r];
                }
            }
            gradient->x[i] = lanes_of(g[0], 1);
            gradient->y[i] = lanes_of(g[1], 1);
            gradient->z[i] = lanes_of(g[2], 1);
            cofactor_[i] = {lanes_of(s.cof.m[0], root), lanes_of(s.cof.m[1], root),
                            lanes_of(s.cof.m[2], root)};
            shape_[i] = static_cast<float>(mu);
        }
    });
}

void ElasticStrain::apply_curvature(LatticeSlopes* slopes) const {
    parallel_for(base_.size(), 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Columns& k = cofactor_[i];
            const Lanes along = k.x * slopes->x[i] + k.y * slopes->y[i] + k.z * slopes->z[i];
            const float sum = (along[0] + along[1]) + along[2];
            slopes->x[i] = shape_[i] * slopes->x[i] + sum * k.x;
            slopes->y[i] = shape_[i] * slopes->y[i] + sum * k.y;
            slopes->z[i] = shape_[i] * slopes->z[i] + sum * k.z;
        }
    });
}

void ElasticStrain::diagonal(LatticeSlopes* out) const {
    out->resize(base_.size());
    for (std::size_t i = 0; i < base_.size(); ++i) {
        const Columns& k = cofactor_[i];
        out->x[i] = shape_[i] + k.x * k.x;
        out->y[i] = shape_[i] + k.y * k.y;
        out->z[i] = shape_[i] + k.z * k.z;
    }
}

}  // namespace sonocase::pipeline::inline registration_elastic
