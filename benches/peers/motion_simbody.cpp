// Motion of the four-bar of `motion.py` by Simbody: METHOD ACCURACY END q1 q2 q3, from rest.
// Prints processor seconds, then for every step t q1 q2 q3 u1 u2 u3.
//
// The loop is two planes, which leaves no redundant row in a plane mechanism (a ball has one).
// RungeKuttaMerson is of order 4 and chooses its steps by an accuracy, which bounds the errors of
// constraints too: it projects onto them. SemiExplicitEuler2 is of order 1, for comparison.
#include <Simbody.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

using namespace SimTK;

static double processor_time() {
    timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

static Body::Rigid rod(double length) {
    const double mass = 2 * length, across = mass * length * length / 12;
    const Vec3 centre(length / 2, 0, 0);
    const Inertia about_centre(1e-4 * mass, across, across);
    return Body::Rigid(MassProperties(mass, centre, about_centre.shiftFromMassCenter(centre, mass)));
}

int main(int count, char** words) {
    if (count != 7) return 1;
    const double crank = 0.4, coupler = 1, rocker = 0.8, ground = 1.1;
    MultibodySystem system;
    SimbodyMatterSubsystem matter(system);
    GeneralForceSubsystem forces(system);
    Force::Gravity(forces, matter, Vec3(0, -9.81, 0));
    MobilizedBody::Pin first(matter.Ground(), Transform(), rod(crank), Transform());
    MobilizedBody::Pin second(first, Transform(Vec3(crank, 0, 0)), rod(coupler), Transform());
    MobilizedBody::Pin third(matter.Ground(), Transform(Vec3(ground, 0, 0)), rod(rocker),
        Transform());
    for (const UnitVec3 normal : {UnitVec3(XAxis), UnitVec3(YAxis)})
        Constraint::PointInPlane(third, normal, dot(normal, Vec3(rocker, 0, 0)), second,
            Vec3(coupler, 0, 0));
    State state = system.realizeTopology();
    for (int i = 0; i < 3; i++) state.updQ()[i] = std::atof(words[4 + i]);
    state.updU() = 0;

    const std::string method = words[1];
    std::unique_ptr<Integrator> integrator;
    if (method == "RungeKuttaMerson")
        integrator = std::make_unique<RungeKuttaMersonIntegrator>(system);
    else
        integrator = std::make_unique<SemiExplicitEuler2Integrator>(system);
    integrator->setAccuracy(std::atof(words[2]));
    const double end = std::atof(words[3]);
    integrator->setFinalTime(end);
    // rows at other times than its steps would be interpolated and projected, each for itself
    integrator->setReturnEveryInternalStep(true);

    std::vector<std::array<double, 7>> rows;
    const auto keep = [&rows](const State& at) {
        const Vector &q = at.getQ(), &u = at.getU();
        rows.push_back({at.getTime(), q[0], q[1], q[2], u[0], u[1], u[2]});
    };
    keep(state);
    const double start = processor_time();
    integrator->initialize(state);
    while (integrator->getTime() < end) {
        // the first call returns at the start
        if (integrator->stepTo(end) != Integrator::StartOfContinuousInterval)
            keep(integrator->getState());
    }
    std::printf("%.17g\n", processor_time() - start);
    for (const std::array<double, 7>& row : rows) {
        for (double x : row) std::printf("%.17g ", x);
        std::printf("\n");
    }
    return 0;
}
