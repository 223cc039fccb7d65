// A cloud of hulls over a floor, asked about by four threads: shapes are shared, each thread has a workspace of its own.
//
//     make && ./threads
#include <collide.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

namespace {

void require(collide_status status) {
    if (status != COLLIDE_OK) throw std::runtime_error(collide_status_text(status));
}

// What the library made is freed by the library.
struct Free {
    void operator()(collide_shape *shape) const { collide_shape_free(shape); }
    void operator()(collide_shape_set *set) const { collide_shape_set_free(set); }
    void operator()(collide_workspace *workspace) const { collide_workspace_free(workspace); }
};
using Shape = std::unique_ptr<collide_shape, Free>;
using ShapeSet = std::unique_ptr<collide_shape_set, Free>;
using Workspace = std::unique_ptr<collide_workspace, Free>;

Workspace workspace() {
    collide_workspace *made = nullptr;
    require(collide_workspace_create(&made));
    return Workspace(made);
}

// A ball of many corners: points of a spiral.
Shape ball(double radius, int corners) {
    std::vector<double> points;
    for (int k = 0; k < corners; ++k) {
        double z = (2.0 * k + 1.0) / corners - 1.0, r = std::sqrt(1.0 - z * z), angle = 2.399963229728653 * k;
        for (double x : {r * std::cos(angle), r * std::sin(angle), z}) points.push_back(radius * x);
    }
    collide_shape *made = nullptr;
    require(collide_hull(points.data(), points.size() / 3, 0.0, &made));
    return Shape(made);
}

struct Question {
    std::vector<std::int64_t> which;  // pairs of numbers in the set
    std::vector<double> X_WA, X_WB;   // 16 doubles a pair
    std::size_t count() const { return which.size() / 2; }
};

void put_pose(std::vector<double> &poses, double x, double y, double z) {
    for (double v : {1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z, 0.0, 0.0, 0.0, 1.0}) poses.push_back(v);
}

// Pairs first ... last - 1, answered with a workspace of this thread.
void answer(const collide_shape_set *set, const Question &asked, std::size_t first, std::size_t last, collide_pair *pairs) {
    Workspace own = workspace();
    collide_poses X_WA = {asked.X_WA.data() + 16 * first, last - first}, X_WB = {asked.X_WB.data() + 16 * first, last - first};
    require(collide_distance_each(own.get(), set, asked.which.data() + 2 * first, last - first, X_WA, X_WB,
                                  std::numeric_limits<double>::infinity(), 0, pairs + first, nullptr));
}

}  // namespace

int main() try {
    const double up[3] = {0.0, 0.0, 1.0};
    collide_shape *made = nullptr;
    require(collide_halfspace(up, 0.0, &made));
    Shape floor(made), small = ball(0.05, 100), large = ball(0.2, 1000);
    const collide_shape *shapes[] = {floor.get(), small.get(), large.get()};
    collide_shape_set *set_made = nullptr;
    require(collide_shape_set_create(shapes, 3, &set_made));
    ShapeSet set(set_made);

    Question asked;
    for (int k = 0; k < 4000; ++k) {
        asked.which.push_back(k % 2);
        asked.which.push_back(2);
        put_pose(asked.X_WA, 0.0, 0.0, 0.0);
        put_pose(asked.X_WB, 0.001 * (k % 700), 0.0, 0.0003 * (k % 1100));
    }
    std::vector<collide_pair> alone(asked.count()), together(asked.count());
    answer(set.get(), asked, 0, asked.count(), alone.data());
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back(answer, set.get(), std::cref(asked), asked.count() * t / 4, asked.count() * (t + 1) / 4,
                             together.data());
    for (auto &thread : threads) thread.join();

    std::size_t hits = 0, same = 0;
    double deepest = 0.0;
    for (std::size_t k = 0; k < asked.count(); ++k) {
        hits += together[k].hit;
        same += together[k].distance == alone[k].distance && together[k].lower == alone[k].lower;
        deepest = std::fmin(deepest, together[k].distance);
    }
    std::printf("%zu of %zu pairs meet, the deepest by %.17g m; %zu answers of four threads are those of one\n", hits,
                asked.count(), -deepest, same);
    return same == asked.count() ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
