// A cloud of hulls over a floor, asked about by four threads: shapes are shared, each thread has a workspace of its own.
//
//     make && ./threads
#include <collide.hpp>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <thread>
#include <vector>

namespace {

// A ball of many corners: points of a spiral.
collide::Shape ball(double radius, int corners) {
    std::vector<double> points;
    for (int k = 0; k < corners; ++k) {
        double z = (2.0 * k + 1.0) / corners - 1.0, r = std::sqrt(1.0 - z * z), angle = 2.399963229728653 * k;
        for (double x : {r * std::cos(angle), r * std::sin(angle), z}) points.push_back(radius * x);
    }
    return collide::Shape::hull(points);
}

struct Question {
    std::vector<std::int64_t> which;  // pairs of numbers in the set
    std::vector<collide::Pose> X_WA, X_WB;
};

// Pairs first ... last - 1, answered with a workspace of this thread.
void answer(const collide::ShapeSet &set, const Question &asked, std::size_t first, std::size_t last, collide_pair *pairs) {
    collide::Workspace own;
    std::size_t n = last - first;
    auto rows = own.distance_each(set, {asked.which.data() + 2 * first, 2 * n}, {asked.X_WA.data() + first, n},
                                  {asked.X_WB.data() + first, n});
    std::copy(rows.begin(), rows.end(), pairs + first);
}

}  // namespace

int main() try {
    std::vector<collide::Shape> shapes;
    shapes.push_back(collide::Shape::halfspace({0.0, 0.0, 1.0}, 0.0));
    shapes.push_back(ball(0.05, 100));
    shapes.push_back(ball(0.2, 1000));
    collide::ShapeSet set(shapes);

    Question asked;
    const std::size_t n = 4000;
    for (std::size_t k = 0; k < n; ++k) {
        asked.which.push_back(k % 2);
        asked.which.push_back(2);
        asked.X_WA.emplace_back();
        asked.X_WB.push_back(collide::Pose::at(0.001 * (k % 700), 0.0, 0.0003 * (k % 1100)));
    }
    std::vector<collide_pair> alone(n), together(n);
    answer(set, asked, 0, n, alone.data());
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < 4; ++t)
        threads.emplace_back(answer, std::cref(set), std::cref(asked), n * t / 4, n * (t + 1) / 4, together.data());
    for (auto &thread : threads) thread.join();

    std::size_t hits = 0, same = 0;
    double deepest = 0.0;
    for (std::size_t k = 0; k < n; ++k) {
        hits += together[k].hit;
        same += together[k].distance == alone[k].distance && together[k].lower == alone[k].lower;
        deepest = std::fmin(deepest, together[k].distance);
    }
    std::printf("%zu of %zu pairs meet, the deepest by %.17g m; %zu answers of four threads are those of one\n", hits, n,
                -deepest, same);
    return same == n ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
