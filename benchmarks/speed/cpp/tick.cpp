// The control tick (matched scheme, fast terminal surface) and the closed loop on Pinocchio's C++ API.
//
//     tick URDF     speaks the protocol of src/rbimpedance/benchmarking/workers.py on standard input and output
//
// Everything is preallocated. aba and rnea get Eigen::Ref<const VectorXd>, for which Pinocchio's library carries
// compiled code; with other types the compiler would make its own, for minutes.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/parsers/urdf.hpp>

using Vector = Eigen::VectorXd;
using Given = Eigen::Ref<const Vector>;

struct Inputs {
  Vector q, v, q_d, v_d, a_d, tau_ext;
};

struct Gains {
  double dt = 1e-3, rate = 2.0, gamma = 3.0, exponent = 0.6, smoothing = 1e-3, k1 = 8.0, k2 = 10.0;
  std::vector<double> filter = std::vector<double>(9, 0.0);  // (q_e, v_e, tau_ext) -> a_e, next q_e, next v_e
};

class Loop {
 public:
  explicit Loop(const std::string& urdf) {
    pinocchio::urdf::buildModel(urdf, model_);
    if (model_.nq != model_.nv) throw std::runtime_error("a joint without a plain coordinate");
    data_ = pinocchio::Data(model_);
    for (Vector* x : {&q_e_, &v_e_, &z_, &command_, &tau_, &q_r_, &s_, &u_, &a_r_, &e1_, &e2_, &torque_})
      *x = Vector::Zero(model_.nv);
  }

  int nv() const { return model_.nv; }

  void reset() { q_e_.setZero(), v_e_.setZero(), z_.setZero(); }

  const Vector& tick(const Inputs& x) {
    const double inner_slope = (2.0 - g.exponent) * std::pow(g.smoothing, g.exponent - 1.0);
    const double inner_curve = (g.exponent - 1.0) * std::pow(g.smoothing, g.exponent - 2.0);
    const double* F = g.filter.data();
    for (int j = 0; j < model_.nv; ++j) {
      const double q_e = q_e_[j], v_e = v_e_[j], t = x.tau_ext[j];
      const double a_e = F[0] * q_e + F[1] * v_e + F[2] * t;  // eq. (3)
      q_r_[j] = x.q_d[j] + q_e;                               // eq. (4)
      e1_[j] = q_r_[j] - x.q[j];
      e2_[j] = x.v_d[j] + v_e - x.v[j];
      a_r_[j] = x.a_d[j] + a_e;
      const double size = std::abs(e1_[j]);  // eq. (6)
      double phi, phi_slope;
      if (size <= g.smoothing) {
        phi = inner_slope * e1_[j] + inner_curve * e1_[j] * size;
        phi_slope = inner_slope + 2.0 * inner_curve * size;
      } else {
        const double power = std::pow(size, g.exponent - 1.0);
        phi = power * e1_[j];
        phi_slope = g.exponent * power;
      }
      const double slope = g.rate + g.gamma * phi_slope;
      const double s = e2_[j] + g.rate * e1_[j] + g.gamma * phi;
      const double root = std::sqrt(std::abs(s));  // eq. (8), matched
      const double d = std::abs(s) + g.dt * g.k1 * root + g.dt * g.dt * g.k2;
      const double u = (g.k1 * root + 2.0 * g.dt * g.k2) * s / d + g.k2 * z_[j];
      command_[j] = a_r_[j] + (slope * e2_[j] + u) / (1.0 + slope * g.dt / 2.0);
      s_[j] = s, u_[j] = u;
      z_[j] += g.dt * s / d;
      q_e_[j] = F[3] * q_e + F[4] * v_e + F[5] * t;
      v_e_[j] = F[6] * q_e + F[7] * v_e + F[8] * t;
    }
    tau_.noalias() = pinocchio::rnea(model_, data_, Given(x.q), Given(x.v), Given(command_)) - x.tau_ext;
    return tau_;
  }

  void rnea(const Inputs& x) { pinocchio::rnea(model_, data_, Given(x.q), Given(x.v), Given(x.a_d)); }

  // One tick, forward dynamics, semi-implicit Euler.
  void advance(Inputs& x) {
    tick(x);
    torque_.noalias() = tau_ + x.tau_ext;
    x.v.noalias() += g.dt * pinocchio::aba(model_, data_, Given(x.q), Given(x.v), Given(torque_));
    x.q.noalias() += g.dt * x.v;
  }

  Gains g;

 private:
  pinocchio::Model model_;
  pinocchio::Data data_;
  Vector q_e_, v_e_, z_, command_, tau_, torque_;
  Vector q_r_, s_, u_, a_r_, e1_, e2_;  // telemetry
};

namespace {

constexpr int kGroup = 10;  // ticks between two readings of the clock

double now() {
  using namespace std::chrono;
  return static_cast<double>(duration_cast<nanoseconds>(steady_clock::now().time_since_epoch()).count());
}

std::vector<double> numbers(std::istringstream& line) {
  std::vector<double> values;
  for (double value; line >> value;) values.push_back(value);
  return values;
}

Inputs inputs(const double* x, int n) {
  auto part = [&](int i) { return Vector(Eigen::Map<const Vector>(x + i * n, n)); };
  return {part(0), part(1), part(2), part(3), part(4), part(5)};
}

template <typename Values>
void answer(const Values& values) {
  for (const double value : values) std::printf("%.17g ", value);
  std::printf("\n");
  std::fflush(stdout);
}

template <typename Step>
std::vector<double> durations(int count, Step step) {
  std::vector<double> result;
  result.reserve(count / kGroup + 1);
  for (int i = 0; i < count; i += kGroup) {
    const double start = now();
    for (int k = 0; k < kGroup; ++k) step(i + k);
    result.push_back((now() - start) / kGroup);
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: tick URDF\n"), 2;
  Loop loop(argv[1]);
  std::vector<Inputs> states;
  for (std::string text; std::getline(std::cin, text);) {
    std::istringstream line(text);
    std::string verb, what;
    line >> verb >> what;
    const std::vector<double> x = numbers(line);
    const int n = loop.nv();
    if (verb == "time" && what == "tick") {
      loop.reset();
      answer(durations(static_cast<int>(x[0]), [&](int i) { loop.tick(states[i % states.size()]); }));
    } else if (verb == "time" && what == "rnea") {
      answer(durations(static_cast<int>(x[0]), [&](int i) { loop.rnea(states[i % states.size()]); }));
    } else if (verb == "time" && what == "loop") {
      Inputs state = states[0];
      loop.reset();
      answer(durations(static_cast<int>(x[0]), [&](int) { loop.advance(state); }));
    } else if (what == "states") {
      states.clear();
      for (std::size_t i = 0; i + 6 * n <= x.size(); i += 6 * n) states.push_back(inputs(&x[i], n));
      answer(std::vector<double>{static_cast<double>(states.size())});
    } else if (what == "filter") {
      loop.g.filter = x;
      answer(x);
    } else if (what == "torques") {  // of one tick after the other, from the first state of the controller
      std::vector<double> torques;
      loop.reset();
      for (const Inputs& state : states) {
        const Vector& tau = loop.tick(state);
        torques.insert(torques.end(), tau.data(), tau.data() + n);
      }
      answer(torques);
    } else if (what == "run") {  // the closed loop from the first state; answers with q and v
      Inputs state = states[0];
      loop.reset();
      for (int i = 0; i < static_cast<int>(x[0]); ++i) loop.advance(state);
      std::vector<double> end(state.q.data(), state.q.data() + n);
      end.insert(end.end(), state.v.data(), state.v.data() + n);
      answer(end);
    }
  }
}
