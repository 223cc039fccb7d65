// A robot for a sampling planner: which states are valid, how far they are from obstacles, which motions are proven free.
//
//     python -c "import collide; ...; checker.save('arm.collide')"
//     make && ./validity arm.collide waypoints.csv
//
// The classes have the functions that OMPL asks of a StateValidityChecker and a MotionValidator; a planner of OMPL takes them once
// they derive from its own. What C leaves to Python counts as invalid: never as free.
#include <collide.hpp>

#include <cstdio>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace {

using State = std::vector<double>;  // a value a joint column

// Workspaces for as many threads as ask at once: planners call const functions from all of theirs.
class Workspaces {
public:
    explicit Workspaces(const collide::Robot &robot) : robot_(robot) {}
    template <class Ask>
    auto with_one(Ask ask) const {
        std::unique_ptr<collide::RobotWorkspace> own = take();
        auto answer = ask(*own);
        std::lock_guard<std::mutex> held(lock_);
        spare_.push_back(std::move(own));
        return answer;
    }

private:
    std::unique_ptr<collide::RobotWorkspace> take() const {
        std::lock_guard<std::mutex> held(lock_);
        if (spare_.empty()) return std::make_unique<collide::RobotWorkspace>(robot_);
        std::unique_ptr<collide::RobotWorkspace> taken = std::move(spare_.back());
        spare_.pop_back();
        return taken;
    }
    const collide::Robot &robot_;
    mutable std::mutex lock_;
    mutable std::vector<std::unique_ptr<collide::RobotWorkspace>> spare_;
};

class StateValidityChecker {
public:
    explicit StateValidityChecker(const collide::Robot &robot) : spaces_(robot) {}
    bool isValid(const State &state) const {
        auto told = spaces_.with_one([&](auto &space) { return space.collides(state); });
        return told.statuses[0] == COLLIDE_OK && told.rows[0] == 0;
    }
    // A proven lower bound of the distance of all tested pairs [m]; 0 where states collide, or nothing is known.
    double clearance(const State &state) const {
        auto told = spaces_.with_one([&](auto &space) { return space.distances(state); });
        return told.statuses[0] == COLLIDE_OK && told.rows[0].lower > 0.0 ? told.rows[0].lower : 0.0;
    }

private:
    Workspaces spaces_;
};

class MotionValidator {
public:
    explicit MotionValidator(const collide::Robot &robot) : spaces_(robot) {}
    bool checkMotion(const State &from, const State &to) const {
        auto told = spaces_.with_one([&](auto &space) { return space.certify(from, to); });
        return told.statuses[0] == COLLIDE_OK && told.rows[0] == COLLIDE_MOTION_FREE;
    }

private:
    Workspaces spaces_;
};

// Rows of numbers, separated by commas or spaces.
std::vector<State> read_states(const char *path, std::size_t columns) {
    std::ifstream file(path);
    std::vector<State> states;
    State state;
    for (double value; file >> value;) {
        if (file.peek() == ',') file.get();
        state.push_back(value);
        if (state.size() == columns) states.push_back(std::exchange(state, {}));
    }
    return states;
}

}  // namespace

int main(int count, char **arguments) try {
    if (count != 3) return std::fprintf(stderr, "usage: validity ROBOT.collide STATES.csv\n"), 2;
    const collide::Robot robot = collide::Robot::load(arguments[1]);
    const StateValidityChecker checker(robot);
    const MotionValidator validator(robot);
    const std::vector<State> states = read_states(arguments[2], robot.columns());
    for (std::size_t k = 0; k < states.size(); ++k) {
        bool is_valid = checker.isValid(states[k]);
        std::printf("state %zu: %s, clearance %.6f m\n", k, is_valid ? "valid" : "invalid", checker.clearance(states[k]));
        if (k > 0) std::printf("motion %zu: %s\n", k - 1, validator.checkMotion(states[k - 1], states[k]) ? "free" : "not proven free");
    }
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
