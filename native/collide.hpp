// collide for C++17: collide.h with owners, exceptions and containers. Header only; link libcollide as C does.
//
//     collide::Workspace workspace;
//     auto box = collide::Shape::box({1.0, 2.0, 0.5}), ball = collide::Shape::sphere(0.25);
//     collide_pair pair = workspace.distance(box, ball, collide::Pose(), collide::Pose::at(2.0, 0.0, 0.0));
//
// Owners. Each class holds a handle of collide.h, which `get` shows and the destructor frees: moved, never copied. A moved-from
// object holds nothing. What is said in collide.h of functions, units, frames and threads holds.
//
// Errors. Whatever is not COLLIDE_OK is thrown as collide::Error, with its status and, of batches, the number of the pair.
//
// Arrays. Span takes a std::vector, a std::array, an array of C, or pointer and size; Pose is 16 doubles, row by row, so that a
// std::vector<Pose> is a batch without a copy. With Eigen on the include path, Pose is made of its transforms and matrices too.
#ifndef COLLIDE_HPP
#define COLLIDE_HPP

#include <collide.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#if defined(__has_include) && !defined(COLLIDE_WITHOUT_EIGEN)
#if __has_include(<Eigen/Core>) && __has_include(<Eigen/Geometry>)
#include <Eigen/Core>
#include <Eigen/Geometry>
#define COLLIDE_WITH_EIGEN 1
#endif
#endif

namespace collide {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t none = static_cast<std::size_t>(-1);

// --- errors ----------------------------------------------------------------------------------------------------------------

class Error : public std::runtime_error {
public:
    explicit Error(collide_status status, std::size_t index = none)
        : std::runtime_error(text(status, index)), status_(status), index_(index) {}
    Error(collide_status status, const std::string &message)
        : std::runtime_error(text(status, none) + (message.empty() ? "" : ": " + message)), status_(status), index_(none) {}
    collide_status status() const noexcept { return status_; }
    // The number of the pair of a batch that is to blame; `none` of single calls.
    std::size_t index() const noexcept { return index_; }

private:
    static std::string text(collide_status status, std::size_t index) {
        std::string about = "collide: ";
        if (index != none) about += "pair " + std::to_string(index) + ": ";
        return about + collide_status_text(status);
    }
    collide_status status_;
    std::size_t index_;
};

inline void require(collide_status status, std::size_t index = none) {
    if (status != COLLIDE_OK) throw Error(status, index);
}

// --- arrays ----------------------------------------------------------------------------------------------------------------

// Elements that somebody else owns.
template <class T>
class Span {
public:
    constexpr Span() noexcept = default;
    constexpr Span(T *data, std::size_t size) noexcept : data_(data), size_(size) {}
    template <std::size_t N>
    constexpr Span(T (&array)[N]) noexcept : data_(array), size_(N) {}
    template <class C, class = std::enable_if_t<std::is_convertible_v<decltype(std::declval<C &>().data()), T *> &&
                                                std::is_integral_v<decltype(std::declval<C &>().size())>>>
    constexpr Span(C &&container) noexcept : data_(container.data()), size_(static_cast<std::size_t>(container.size())) {}
    constexpr T *data() const noexcept { return data_; }
    constexpr std::size_t size() const noexcept { return size_; }
    constexpr bool empty() const noexcept { return size_ == 0; }
    constexpr T &operator[](std::size_t k) const { return data_[k]; }
    constexpr T *begin() const noexcept { return data_; }
    constexpr T *end() const noexcept { return data_ + size_; }

private:
    T *data_ = nullptr;
    std::size_t size_ = 0;
};

// How many rows of `width` numbers there are. Throws where numbers are left over.
template <class T>
std::size_t rows(Span<T> numbers, std::size_t width) {
    if (width == 0 || numbers.size() % width != 0) throw Error(COLLIDE_INVALID_ARGUMENT);
    return numbers.size() / width;
}

using Vector = std::array<double, 3>;

// A pose X_WB: a 4x4 matrix row by row, p_W = X_WB p_B; the identity at first.
struct Pose {
    std::array<double, 16> m{1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0};

    Pose() = default;
    Pose(const std::array<double, 16> &row_by_row) : m(row_by_row) {}
    static Pose at(double x, double y, double z) {
        Pose made;
        made.m[3] = x, made.m[7] = y, made.m[11] = z;
        return made;
    }
    static Pose at(const Vector &place) { return at(place[0], place[1], place[2]); }
    const double *data() const noexcept { return m.data(); }
    double operator()(int row, int column) const { return m[static_cast<std::size_t>(4 * row + column)]; }
#ifdef COLLIDE_WITH_EIGEN
    // Of a 4x4 matrix in whichever order it is stored, or of a transform such as Eigen::Isometry3d.
    template <class Derived>
    Pose(const Eigen::MatrixBase<Derived> &matrix) {
        static_assert(Derived::RowsAtCompileTime == 4 && Derived::ColsAtCompileTime == 4, "a pose is a 4x4 matrix");
        map() = matrix;
    }
    template <int Mode, int Options>
    Pose(const Eigen::Transform<double, 3, Mode, Options> &X_WB) {
        static_assert(Mode != int(Eigen::Projective), "a pose keeps parallels: its last row is 0 0 0 1");
        map().template topRows<3>() = X_WB.matrix().template topRows<3>();
    }
    Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> map() {
        return Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(m.data());
    }
    Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> map() const {
        return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(m.data());
    }
#endif
};
static_assert(sizeof(Pose) == 16 * sizeof(double) && std::is_trivially_copyable_v<Pose>, "poses lie one behind another");

#ifdef COLLIDE_WITH_EIGEN
// Three doubles of a row, such as pair.normal, as a vector of Eigen's.
inline Eigen::Map<const Eigen::Vector3d> vector(const double (&row)[3]) { return Eigen::Map<const Eigen::Vector3d>(row); }
#endif

// The poses of a batch; a single one goes with all of the other body's.
struct Poses : Span<const Pose> {
    using Span<const Pose>::Span;
    Poses(const Pose &one) : Span<const Pose>(&one, 1) {}
    operator collide_poses() const { return {empty() ? nullptr : data()->data(), size()}; }
};

// Vectors of a batch, x y z of each; a single one goes with all.
struct Vectors : Span<const double> {
    using Span<const double>::Span;
    std::size_t count() const { return rows<const double>(*this, 3); }
    operator collide_vectors() const { return {data(), count()}; }
};

// How many rows a batch of so many each has: the most of them, 0 where there are none of one.
inline std::size_t longest(std::initializer_list<std::size_t> counts) {
    return std::min(counts) == 0 ? 0 : std::max(counts);
}

// --- owners ----------------------------------------------------------------------------------------------------------------

// Owns a handle that a function of collide.h made and `Free` frees.
template <class H, void (*Free)(H *)>
class Owner {
public:
    explicit Owner(H *handle) noexcept : handle_(handle) {}
    H *get() const noexcept { return handle_.get(); }
    explicit operator bool() const noexcept { return handle_ != nullptr; }

protected:
    // What `function` makes of arguments: its last one is where the handle goes.
    template <class Function, class... Arguments>
    static H *made(Function function, Arguments... arguments) {
        H *handle = nullptr;
        require(function(arguments..., &handle));
        return handle;
    }

private:
    struct Deleter {
        void operator()(H *handle) const noexcept { Free(handle); }
    };
    std::unique_ptr<H, Deleter> handle_;
};

class Shape : public Owner<collide_shape, collide_shape_free> {
public:
    using Owner::Owner;
    static Shape sphere(double radius) { return Shape(made(collide_sphere, radius)); }
    static Shape box(const Vector &size) { return Shape(made(collide_box, size.data())); }
    static Shape capsule(double radius, double length) { return Shape(made(collide_capsule, radius, length)); }
    static Shape cylinder(double radius, double length) { return Shape(made(collide_cylinder, radius, length)); }
    static Shape cone(double radius, double length) { return Shape(made(collide_cone, radius, length)); }
    static Shape ellipsoid(const Vector &radii) { return Shape(made(collide_ellipsoid, radii.data())); }
    static Shape halfspace(const Vector &normal, double offset) {
        return Shape(made(collide_halfspace, normal.data(), offset));
    }
    // points : x y z of each.
    static Shape hull(Span<const double> points, double radius = 0.0) {
        return Shape(made(collide_hull, points.data(), rows(points, 3), radius));
    }
    // normals : x y z of each.
    static Shape hpolytope(Span<const double> normals, Span<const double> offsets) {
        if (normals.size() != 3 * offsets.size()) throw Error(COLLIDE_INVALID_ARGUMENT);
        return Shape(made(collide_hpolytope, normals.data(), offsets.data(), offsets.size()));
    }
};

inline std::vector<const collide_shape *> handles_of(Span<const Shape> shapes) {
    std::vector<const collide_shape *> made;
    for (const Shape &shape : shapes) made.push_back(shape.get());
    return made;
}

// Shapes under numbers, which it does not own: they outlive it.
class ShapeSet : public Owner<collide_shape_set, collide_shape_set_free> {
public:
    using Owner::Owner;
    explicit ShapeSet(Span<const collide_shape *const> shapes)
        : Owner(made(collide_shape_set_create, shapes.data(), shapes.size())) {}
    explicit ShapeSet(Span<const Shape> shapes) : ShapeSet(handles_of(shapes)) {}
};

// The union of shapes at poses in its frame. It does not own the shapes: they outlive it.
class Compound : public Owner<collide_compound, collide_compound_free> {
public:
    using Owner::Owner;
    Compound(Span<const collide_shape *const> shapes, Span<const Pose> X_CPs) : Owner(made_of(shapes, X_CPs)) {}
    Compound(Span<const Shape> shapes, Span<const Pose> X_CPs) : Compound(handles_of(shapes), X_CPs) {}

private:
    static collide_compound *made_of(Span<const collide_shape *const> shapes, Span<const Pose> X_CPs) {
        if (shapes.size() != X_CPs.size() || shapes.empty()) throw Error(COLLIDE_INVALID_ARGUMENT);
        return made(collide_compound_create, shapes.data(), X_CPs.data()->data(), shapes.size());
    }
};

class Mesh : public Owner<collide_mesh, collide_mesh_free> {
public:
    using Owner::Owner;
    // vertices : x y z of each.   faces : three numbers of vertices each.   solid : COLLIDE_SURFACE, _SOLID, _SOLID_IF_CLOSED.
    Mesh(Span<const double> vertices, Span<const std::int32_t> faces, int solid = COLLIDE_SOLID_IF_CLOSED)
        : Owner(made(collide_mesh_create, vertices.data(), rows(vertices, 3), faces.data(), rows(faces, 3), solid)) {}
    explicit Mesh(const Shape &shape) : Owner(made(collide_mesh_of_shape, shape.get())) {}
    // Terrain: heights row by row, NaN in holes.   cell : its sides along x and y.
    static Mesh height_field(Span<const double> heights, std::size_t columns, const std::array<double, 2> &cell) {
        return Mesh(made(collide_height_field_create, heights.data(), rows(heights, columns), columns, cell.data(), nullptr));
    }
    static Mesh height_field(Span<const double> heights, std::size_t columns, const std::array<double, 2> &cell, double bottom) {
        return Mesh(made(collide_height_field_create, heights.data(), rows(heights, columns), columns, cell.data(), &bottom));
    }
};

class Field : public Owner<collide_field, collide_field_free> {
public:
    using Owner::Owner;
    // points : x y z of each.   radii : one for all, or one each.
    static Field point_cloud(Span<const double> points, Span<const double> radii) {
        return Field(made(collide_point_cloud_create, points.data(), rows(points, 3), radii.data(), radii.size()));
    }
    static Field point_cloud(Span<const double> points, double radius) {
        return point_cloud(points, Span<const double>(&radius, 1));
    }
    // occupied : a byte a cell, cell i, j, k at (i cells[1] + j) cells[2] + k.
    static Field voxel_grid(Span<const std::uint8_t> occupied, const std::array<std::size_t, 3> &cells, const Vector &cell,
                            const Vector &origin = {}) {
        std::size_t left = occupied.size();
        for (std::size_t n : cells) left = n != 0 && left % n == 0 ? left / n : 0; // never a product, which may overflow
        if (left != 1) throw Error(COLLIDE_INVALID_ARGUMENT);
        return Field(made(collide_voxel_grid_create, occupied.data(), cells.data(), cell.data(), origin.data()));
    }

    struct Nearest {
        std::vector<double> distances;  // k a place; infinite where there are fewer
        std::vector<std::int64_t> rows; // and -1
    };
    // places : x y z of each.
    Nearest nearest(Span<const double> places, std::size_t k, double max_distance = infinity) const {
        std::size_t n = rows(places, 3);
        if (k == 0 || n > none / sizeof(double) / k) throw Error(COLLIDE_INVALID_ARGUMENT);
        Nearest found{std::vector<double>(n * k), std::vector<std::int64_t>(n * k)};
        require(collide_point_cloud_nearest(get(), places.data(), n, k, max_distance, found.distances.data(), found.rows.data()));
        return found;
    }
    // Numbers of the points within a distance of a place, ascending.
    std::vector<std::int64_t> within(const Vector &place, double r) const {
        std::size_t count = 0;
        collide_status status = collide_point_cloud_within(get(), place.data(), r, nullptr, 0, &count);
        if (status != COLLIDE_TOO_MANY) require(status);
        std::vector<std::int64_t> found(count);
        if (count != 0) require(collide_point_cloud_within(get(), place.data(), r, found.data(), count, &count));
        return found;
    }
};

// --- questions -------------------------------------------------------------------------------------------------------------

// n rows, written by a function that tells which of them is to blame where one fails.
template <class Row, class Ask>
std::vector<Row> answers(std::size_t n, Ask ask) {
    std::vector<Row> rows(n);
    std::size_t failed = none;
    collide_status status = ask(rows.data(), &failed);
    require(status, failed);
    return rows;
}

// All rows of a function that says how many there are where they are more than it has room for; `width` elements a row.
template <class Row, class Ask>
std::vector<Row> all_rows(Ask ask, std::size_t width = 1) {
    std::vector<Row> rows(64 * width);
    for (;;) {
        std::size_t count = 0;
        collide_status status = ask(rows.data(), rows.size() / width, &count);
        if (status != COLLIDE_TOO_MANY) require(status);
        rows.resize(count * width);
        if (status != COLLIDE_TOO_MANY) return rows;
    }
}

// Rows of contacts of many pairs: those of pair k are starts[k] to starts[k + 1] - 1.
struct Contacts {
    std::vector<collide_contact> rows;
    std::vector<std::size_t> starts;
    Span<const collide_contact> of(std::size_t pair) const {
        return {rows.data() + starts.at(pair), starts.at(pair + 1) - starts.at(pair)};
    }
};

// Rows of which some may be without an answer: where statuses[k] is not COLLIDE_OK row k tells nothing.
template <class Row>
struct Answered {
    std::vector<Row> rows;
    std::vector<collide_status> statuses;
};

// n of these. Throws where nothing is answered at all.
template <class Row, class Ask>
Answered<Row> answered(std::size_t n, Ask ask) {
    std::vector<collide_status> statuses(n);
    auto rows = answers<Row>(n, [&](Row *rows, std::size_t *failed) {
        collide_status status = ask(rows, statuses.data(), failed);
        bool is_of_a_row = status == COLLIDE_UNSUPPORTED || status == COLLIDE_OUT_OF_RANGE || status == COLLIDE_ENDLESS_DEPTH;
        return is_of_a_row ? COLLIDE_OK : status;
    });
    return {std::move(rows), std::move(statuses)};
}

// Scratch memory, one a thread, and the questions asked with it. `collides` is collide_collide of whatever kind of body.
// which : two numbers of a set's shapes a pair.   axes : none, or 3 doubles a pair, read and written.
class Workspace : public Owner<collide_workspace, collide_workspace_free> {
public:
    using Owner::Owner;
    Workspace() : Owner(made(collide_workspace_create)) {}

    bool collides(const Shape &A, const Shape &B, const Pose &X_WA, const Pose &X_WB, unsigned flags = 0) {
        return boolean(collide_collide, A, B, X_WA, X_WB, flags);
    }
    bool collides(const Mesh &A, const Mesh &B, const Pose &X_WA, const Pose &X_WB, unsigned flags = 0) {
        return boolean(collide_mesh_collide, A, B, X_WA, X_WB, flags);
    }
    bool collides(const Mesh &mesh, const Shape &shape, const Pose &X_WM, const Pose &X_WS, unsigned flags = 0) {
        return boolean(collide_mesh_shape_collide, mesh, shape, X_WM, X_WS, flags);
    }
    bool collides(const Field &field, const Shape &shape, const Pose &X_WF, const Pose &X_WS, unsigned flags = 0) {
        return boolean(collide_field_collide, field, shape, X_WF, X_WS, flags);
    }

    collide_pair distance(const Shape &A, const Shape &B, const Pose &X_WA, const Pose &X_WB, double max_distance = infinity,
                          unsigned flags = 0) {
        return row(collide_distance, A, B, X_WA, X_WB, max_distance, flags);
    }
    collide_pair distance(const Mesh &A, const Mesh &B, const Pose &X_WA, const Pose &X_WB, unsigned flags = 0) {
        return row(collide_mesh_distance, A, B, X_WA, X_WB, flags);
    }
    collide_pair distance(const Mesh &mesh, const Shape &shape, const Pose &X_WM, const Pose &X_WS,
                          unsigned flags = COLLIDE_UNSIGNED) {
        return row(collide_mesh_shape_distance, mesh, shape, X_WM, X_WS, flags);
    }
    collide_pair distance(const Field &field, const Shape &shape, const Pose &X_WF, const Pose &X_WS,
                          double max_distance = infinity, unsigned flags = COLLIDE_UNSIGNED) {
        return row(collide_field_distance, field, shape, X_WF, X_WS, max_distance, flags);
    }

    std::vector<std::uint8_t> collides_batch(const Shape &A, const Shape &B, Poses X_WA, Poses X_WB, unsigned flags = 0,
                                             Span<double> axes = {}) {
        std::size_t n = longest({X_WA.size(), X_WB.size()});
        return answers<std::uint8_t>(n, [&](std::uint8_t *hits, std::size_t *failed) {
            return collide_collide_batch(get(), A.get(), B.get(), X_WA, X_WB, flags, checked(axes, n), hits, failed);
        });
    }
    std::vector<std::uint8_t> collides_batch(const Compound &A, const Compound &B, Poses X_WA, Poses X_WB, unsigned flags = 0) {
        return answers<std::uint8_t>(longest({X_WA.size(), X_WB.size()}), [&](std::uint8_t *hits, std::size_t *failed) {
            return collide_compound_collide(get(), A.get(), B.get(), X_WA, X_WB, flags, hits, failed);
        });
    }
    // Whether A and B are at most a margin apart.
    std::vector<std::uint8_t> within_batch(const Shape &A, const Shape &B, Poses X_WA, Poses X_WB, double margin,
                                           unsigned flags = 0) {
        return answers<std::uint8_t>(longest({X_WA.size(), X_WB.size()}), [&](std::uint8_t *within, std::size_t *failed) {
            return collide_within(get(), A.get(), B.get(), X_WA, X_WB, margin, flags, within, failed);
        });
    }
    std::vector<std::uint8_t> collides_batch(const Field &field, const Shape &shape, Poses X_WF, Poses X_WS, unsigned flags = 0) {
        return answers<std::uint8_t>(longest({X_WF.size(), X_WS.size()}), [&](std::uint8_t *hits, std::size_t *failed) {
            return collide_field_collide_batch(get(), field.get(), shape.get(), X_WF, X_WS, flags, hits, failed);
        });
    }
    std::vector<std::uint8_t> collides_each(const ShapeSet &set, Span<const std::int64_t> which, Poses X_WA, Poses X_WB,
                                            unsigned flags = 0, Span<double> axes = {}) {
        std::size_t n = rows(which, 2);
        return answers<std::uint8_t>(n, [&](std::uint8_t *hits, std::size_t *failed) {
            return collide_collide_each(get(), set.get(), which.data(), n, X_WA, X_WB, flags, checked(axes, n), hits, failed);
        });
    }

    std::vector<collide_pair> distance_batch(const Shape &A, const Shape &B, Poses X_WA, Poses X_WB,
                                             double max_distance = infinity, unsigned flags = 0) {
        return answers<collide_pair>(longest({X_WA.size(), X_WB.size()}), [&](collide_pair *pairs, std::size_t *failed) {
            return collide_distance_batch(get(), A.get(), B.get(), X_WA, X_WB, max_distance, flags, pairs, failed);
        });
    }
    std::vector<collide_pair> distance_batch(const Compound &A, const Compound &B, Poses X_WA, Poses X_WB,
                                             double max_distance = infinity, unsigned flags = 0) {
        return answers<collide_pair>(longest({X_WA.size(), X_WB.size()}), [&](collide_pair *pairs, std::size_t *failed) {
            return collide_compound_distance(get(), A.get(), B.get(), X_WA, X_WB, max_distance, flags, pairs, failed);
        });
    }
    Answered<collide_pair> distance_batch(const Field &field, const Shape &shape, Poses X_WF, Poses X_WS,
                                          double max_distance = infinity, unsigned flags = COLLIDE_UNSIGNED) {
        return answered<collide_pair>(longest({X_WF.size(), X_WS.size()}), [&](auto... out) {
            return collide_field_distance_batch(get(), field.get(), shape.get(), X_WF, X_WS, max_distance, flags, out...);
        });
    }
    std::vector<collide_pair> distance_each(const ShapeSet &set, Span<const std::int64_t> which, Poses X_WA, Poses X_WB,
                                            double max_distance = infinity, unsigned flags = 0) {
        std::size_t n = rows(which, 2);
        return answers<collide_pair>(n, [&](collide_pair *pairs, std::size_t *failed) {
            return collide_distance_each(get(), set.get(), which.data(), n, X_WA, X_WB, max_distance, flags, pairs, failed);
        });
    }

    std::vector<collide_contact> contacts(const Shape &A, const Shape &B, const Pose &X_WA, const Pose &X_WB, double margin = 0.0,
                                          std::size_t max_contacts = 4, unsigned flags = 0) {
        std::vector<collide_contact> found(max_contacts);
        std::size_t count = 0;
        require(collide_contacts(get(), A.get(), B.get(), X_WA.data(), X_WB.data(), margin, max_contacts, flags, found.data(),
                                 &count));
        found.resize(count);
        return found;
    }
    Contacts contacts_batch(const Shape &A, const Shape &B, Poses X_WA, Poses X_WB, double margin = 0.0,
                            std::size_t max_contacts = 4, unsigned flags = 0) {
        return many_contacts(longest({X_WA.size(), X_WB.size()}), max_contacts, [&](auto... out) {
            return collide_contacts_batch(get(), A.get(), B.get(), X_WA, X_WB, margin, max_contacts, flags, out...);
        });
    }
    Contacts contacts_each(const ShapeSet &set, Span<const std::int64_t> which, Poses X_WA, Poses X_WB, double margin = 0.0,
                           std::size_t max_contacts = 4, unsigned flags = 0) {
        std::size_t n = rows(which, 2);
        return many_contacts(n, max_contacts, [&](auto... out) {
            return collide_contacts_each(get(), set.get(), which.data(), n, X_WA, X_WB, margin, max_contacts, flags, out...);
        });
    }

    std::vector<collide_contact> contacts(const Mesh &A, const Mesh &B, const Pose &X_WA, const Pose &X_WB, double margin = 0.0,
                                          std::size_t max_contacts = 4, unsigned flags = 0) {
        return all_rows<collide_contact>([&](auto... out) {
            return collide_mesh_contacts(get(), A.get(), B.get(), X_WA.data(), X_WB.data(), margin, max_contacts, flags, out...);
        });
    }
    std::vector<collide_contact> contacts(const Compound &A, const Compound &B, const Pose &X_WA, const Pose &X_WB,
                                          double margin = 0.0, std::size_t max_contacts = 4, unsigned flags = 0) {
        return all_rows<collide_contact>([&](auto... out) {
            return collide_compound_contacts(get(), A.get(), B.get(), X_WA.data(), X_WB.data(), margin, max_contacts, flags,
                                             out...);
        });
    }

    std::vector<collide_contact> contacts(const Mesh &mesh, const Shape &shape, const Pose &X_WM, const Pose &X_WS,
                                          double margin = 0.0, std::size_t max_contacts = 4, unsigned flags = 0) {
        return all_rows<collide_contact>([&](auto... out) {
            return collide_mesh_shape_contacts(get(), mesh.get(), shape.get(), X_WM.data(), X_WS.data(), margin, max_contacts,
                                               flags, out...);
        });
    }
    std::vector<collide_contact> contacts(const Field &field, const Shape &shape, const Pose &X_WF, const Pose &X_WS,
                                          double margin = 0.0, std::size_t max_contacts = 4, unsigned flags = 0) {
        return all_rows<collide_contact>([&](auto... out) {
            return collide_field_contacts(get(), field.get(), shape.get(), X_WF.data(), X_WS.data(), margin, max_contacts, flags,
                                          out...);
        });
    }

    // How far A can be moved along a direction until it touches B.
    Answered<collide_first_contact> cast_batch(const Shape &A, const Shape &B, Poses X_WA, Poses X_WB, Vectors directions,
                                               double max_distance = infinity, unsigned flags = 0) {
        std::size_t n = longest({X_WA.size(), X_WB.size(), directions.count()});
        return answered<collide_first_contact>(n, [&](auto... out) {
            return collide_cast_batch(get(), A.get(), B.get(), X_WA, X_WB, directions, max_distance, flags, out...);
        });
    }
    collide_first_contact cast(const Compound &A, const Compound &B, const Pose &X_WA, const Pose &X_WB, const Vector &direction,
                               double max_distance = infinity, unsigned flags = 0) {
        collide_first_contact first;
        require(collide_compound_cast(get(), A.get(), B.get(), X_WA.data(), X_WB.data(), direction.data(), max_distance, flags,
                                      &first));
        return first;
    }
    collide_first_contact cast(const Shape &shape, const Field &field, const Pose &X_WS, const Pose &X_WF, const Vector &direction,
                               double max_distance = infinity, unsigned flags = 0) {
        collide_first_contact first;
        require(collide_field_cast(get(), shape.get(), field.get(), X_WS.data(), X_WF.data(), direction.data(), max_distance, flags,
                                   &first));
        return first;
    }
    // When A and B first touch on their ways from the first poses to the second, turning the shortest way.
    Answered<collide_time_of_impact> impact_batch(const Shape &A, const Shape &B, Poses X_WA0, Poses X_WA1, Poses X_WB0,
                                                  Poses X_WB1, double tolerance = 1e-9, unsigned flags = 0) {
        std::size_t n = longest({X_WA0.size(), X_WA1.size(), X_WB0.size(), X_WB1.size()});
        const collide_motions motions = {X_WA0, X_WA1, X_WB0, X_WB1, {nullptr, 1}, {nullptr, 1}};
        return answered<collide_time_of_impact>(n, [&](auto... out) {
            return collide_impact_batch(get(), A.get(), B.get(), &motions, tolerance, flags, out...);
        });
    }
    // Where rays first meet a shape, a union, a mesh or a field.
    Answered<collide_ray_hit> raycast(const Shape &shape, Poses X_WA, Vectors origins, Vectors directions,
                                      double max_distance = infinity, unsigned flags = 0) {
        return rays(collide_raycast, shape, X_WA, origins, directions, max_distance, flags);
    }
    Answered<collide_ray_hit> raycast(const Compound &compound, Poses X_WA, Vectors origins, Vectors directions,
                                      double max_distance = infinity, unsigned flags = 0) {
        return rays(collide_compound_raycast, compound, X_WA, origins, directions, max_distance, flags);
    }
    Answered<collide_ray_hit> raycast(const Mesh &mesh, Poses X_WA, Vectors origins, Vectors directions,
                                      double max_distance = infinity, unsigned flags = 0) {
        return rays(collide_mesh_raycast, mesh, X_WA, origins, directions, max_distance, flags);
    }
    Answered<collide_ray_hit> raycast(const Field &field, Poses X_WF, Vectors origins, Vectors directions,
                                      double max_distance = infinity, unsigned flags = 0) {
        return rays(collide_field_raycast, field, X_WF, origins, directions, max_distance, flags);
    }

private:
    template <class Function, class Target>
    Answered<collide_ray_hit> rays(Function ask, const Target &target, Poses X_WA, Vectors origins, Vectors directions,
                                   double max_distance, unsigned flags) {
        std::size_t n = longest({X_WA.size(), origins.count(), directions.count()});
        return answered<collide_ray_hit>(n, [&](auto... out) {
            return ask(get(), target.get(), X_WA, origins, directions, max_distance, flags, out...);
        });
    }
    template <class Function, class A, class B>
    bool boolean(Function ask, const A &a, const B &b, const Pose &X_WA, const Pose &X_WB, unsigned flags) {
        int hit = 0;
        require(ask(get(), a.get(), b.get(), X_WA.data(), X_WB.data(), flags, &hit));
        return hit != 0;
    }
    template <class Function, class A, class B, class... Rest>
    collide_pair row(Function ask, const A &a, const B &b, const Pose &X_WA, const Pose &X_WB, Rest... rest) {
        collide_pair pair;
        require(ask(get(), a.get(), b.get(), X_WA.data(), X_WB.data(), rest..., &pair));
        return pair;
    }
    static double *checked(Span<double> axes, std::size_t pairs) {
        if (!axes.empty() && axes.size() != 3 * pairs) throw Error(COLLIDE_INVALID_ARGUMENT);
        return axes.data();
    }
    template <class Ask>
    static Contacts many_contacts(std::size_t pairs, std::size_t max_contacts, Ask ask) {
        if (max_contacts == 0 || pairs > none / sizeof(collide_contact) / max_contacts) throw Error(COLLIDE_INVALID_ARGUMENT);
        std::vector<std::size_t> starts(pairs + 1);
        auto rows = answers<collide_contact>(pairs * max_contacts, [&](collide_contact *rows, std::size_t *failed) {
            return ask(rows, pairs * max_contacts, starts.data(), failed);
        });
        rows.resize(starts[pairs]);
        return {std::move(rows), std::move(starts)};
    }
};

// --- worlds ----------------------------------------------------------------------------------------------------------------

// Bodies that move, and questions about all of them. It owns no shape, mesh or field: they outlive their bodies. Questions change
// nothing: threads ask at once, each with its own workspace, while nobody changes the world.
class World : public Owner<collide_world, collide_world_free> {
public:
    using Owner::Owner;
    World() : Owner(made(collide_world_create)) {}

    std::int32_t add(const Shape &shape, const Pose &X_WB = {}, bool is_static = false, std::uint32_t group = 1u,
                     std::uint32_t mask = 0xFFFFu) {
        return added(&collide_body::shape, shape.get(), X_WB, is_static, group, mask);
    }
    std::int32_t add(const Mesh &mesh, const Pose &X_WB = {}, bool is_static = false, std::uint32_t group = 1u,
                     std::uint32_t mask = 0xFFFFu) {
        return added(&collide_body::mesh, mesh.get(), X_WB, is_static, group, mask);
    }
    std::int32_t add(const Field &field, const Pose &X_WB = {}, bool is_static = false, std::uint32_t group = 1u,
                     std::uint32_t mask = 0xFFFFu) {
        return added(&collide_body::field, field.get(), X_WB, is_static, group, mask);
    }
    std::vector<std::int32_t> add(Span<const collide_body> bodies) {
        std::vector<std::int32_t> ids(bodies.size());
        changed(collide_world_add(get(), bodies.data(), bodies.size(), ids.data()));
        return ids;
    }
    void remove(std::int32_t id) { changed(collide_world_remove(get(), id)); }
    void move(std::int32_t id, const Pose &X_WB) { changed(collide_world_move(get(), &id, 1, X_WB.data())); }
    void move(Span<const std::int32_t> ids, Span<const Pose> X_WBs) {
        if (ids.size() != X_WBs.size()) throw Error(COLLIDE_INVALID_ARGUMENT);
        if (!ids.empty()) changed(collide_world_move(get(), ids.data(), ids.size(), X_WBs.data()->data()));
    }
    void replace(std::int32_t id, const Shape &shape) { changed(collide_world_replace(get(), id, shape.get())); }
    void replace(std::int32_t id, const Mesh &mesh) { changed(collide_world_replace_mesh(get(), id, mesh.get())); }
    void replace(std::int32_t id, const Field &field) { changed(collide_world_replace_field(get(), id, field.get())); }
    void sleep(Span<const std::int32_t> ids, bool asleep = true) {
        changed(collide_world_sleep(get(), ids.data(), ids.size(), asleep));
    }
    // pairs : two ids each, never tested from now on.
    void allow(Span<const std::int32_t> pairs) { changed(collide_world_allow(get(), pairs.data(), rows(pairs, 2))); }

    // Margins [m] of bodies: pairs so near count as hits.
    void set_margins(Span<const std::int32_t> ids, Span<const double> margins) {
        if (ids.size() != margins.size()) throw Error(COLLIDE_INVALID_ARGUMENT);
        changed(collide_world_set_margins(get(), ids.data(), ids.size(), margins.data()));
    }
    void set_margin(std::int32_t id, double margin) { changed(collide_world_set_margins(get(), &id, 1, &margin)); }
    // A margin of a pair, instead of the sum of both bodies'; nullopt: the pair loses it.
    void set_pair_margin(std::int32_t a, std::int32_t b, std::optional<double> margin) {
        const std::int32_t pair[2] = {a, b};
        changed(collide_world_set_pair_margins(get(), pair, 1, margin ? &*margin : nullptr));
    }

    std::size_t size() const { return collide_world_size(get()); }
    Pose pose(std::int32_t id) const {
        Pose X_WB;
        require(collide_world_pose(get(), id, X_WB.m.data()));
        return X_WB;
    }

    bool collides(Workspace &space) const {
        int hit = 0;
        told(space, collide_world_collides(get(), space.get(), &hit));
        return hit != 0;
    }
    // Whether any pair is at most a margin apart, or the sum of it and its own.
    bool within(Workspace &space, double margin) const {
        int hit = 0;
        told(space, collide_world_within(get(), space.get(), margin, &hit));
        return hit != 0;
    }
    // Pairs that hit: two ids each.
    std::vector<std::int32_t> hits(Workspace &space) const { return all<std::int32_t>(space, 2, collide_world_hits); }
    std::vector<collide_pair> collisions(Workspace &space) const { return all<collide_pair>(space, 1, collide_world_collisions); }
    std::vector<collide_pair> distances(Workspace &space, double max_distance = infinity) const {
        return all<collide_pair>(space, 1, collide_world_distances, max_distance);
    }
    std::optional<collide_pair> minimum(Workspace &space, double max_distance = infinity) const {
        collide_pair row;
        std::size_t count = 0;
        told(space, collide_world_minimum(get(), space.get(), max_distance, &row, &count));
        return count == 0 ? std::nullopt : std::optional<collide_pair>(row);
    }
    std::vector<collide_contact> contacts(Workspace &space, double margin = 0.0, std::size_t max_contacts = 4) const {
        return all<collide_contact>(space, 1, collide_world_contacts, margin, max_contacts);
    }
    std::vector<collide_pair> query(Workspace &space, const Shape &shape, const Pose &X_WS, double max_distance = 0.0) const {
        return all<collide_pair>(space, 1, collide_world_query, static_cast<const collide_shape *>(shape.get()), X_WS.data(),
                                 max_distance);
    }
    std::vector<std::int32_t> boxes_near(Workspace &space, const Vector &low_W, const Vector &high_W, double margin = 0.0) const {
        return all<std::int32_t>(space, 1, collide_world_boxes_near, low_W.data(), high_W.data(), margin);
    }
    // The first body on each ray, x y z of origins and directions.
    Answered<collide_world_hit> raycast(Workspace &space, Span<const double> origins_W, Span<const double> directions_W,
                                        double max_distance = infinity) const {
        std::size_t n = rows(origins_W, 3);
        if (directions_W.size() != origins_W.size()) throw Error(COLLIDE_INVALID_ARGUMENT);
        Answered<collide_world_hit> found{std::vector<collide_world_hit>(n), std::vector<collide_status>(n)};
        collide_status status = collide_world_raycast(get(), space.get(), origins_W.data(), directions_W.data(), n, max_distance,
                                                      nullptr, nullptr, found.rows.data(), found.statuses.data());
        if (status != COLLIDE_UNSUPPORTED) told(space, status);
        return found;
    }
    // The first body touched by a shape from outside that moves along a direction.
    Answered<collide_world_hit> cast(Workspace &space, const Shape &shape, Poses X_WS, Vectors directions_W,
                                     double max_distance = infinity, unsigned flags = 0) const {
        std::size_t n = longest({X_WS.size(), directions_W.count()});
        Answered<collide_world_hit> found{std::vector<collide_world_hit>(n), std::vector<collide_status>(n)};
        collide_status status = collide_world_cast(get(), space.get(), shape.get(), X_WS, directions_W, max_distance, flags, nullptr,
                                                   nullptr, found.rows.data(), found.statuses.data());
        if (status != COLLIDE_UNSUPPORTED) told(space, status);
        return found;
    }
    // The body nearest to each point, x y z of each.
    std::vector<collide_world_hit> nearest(Workspace &space, Span<const double> points_W, double max_distance = infinity) const {
        std::vector<collide_world_hit> found(rows(points_W, 3));
        told(space, collide_world_nearest(get(), space.get(), points_W.data(), found.size(), max_distance, nullptr, nullptr,
                                          found.data()));
        return found;
    }

private:
    template <class Kind>
    std::int32_t added(const Kind *collide_body::*of, const Kind *what, const Pose &X_WB, bool is_static, std::uint32_t group,
                       std::uint32_t mask) {
        collide_body body = COLLIDE_BODY_DEFAULT;
        body.*of = what;
        body.X_WB = X_WB.data();
        body.is_static = is_static;
        body.group = group;
        body.mask = mask;
        return add(Span<const collide_body>(&body, 1)).front();
    }
    void changed(collide_status status) const {
        if (status != COLLIDE_OK) throw Error(status, collide_world_message(get()));
    }
    static void told(const Workspace &space, collide_status status) {
        if (status != COLLIDE_OK) throw Error(status, collide_workspace_message(space.get()));
    }
    template <class Row, class Function, class... Arguments>
    std::vector<Row> all(Workspace &space, std::size_t width, Function ask, Arguments... arguments) const {
        return all_rows<Row>([&](auto... out) {
            collide_status status = ask(get(), space.get(), arguments..., out...);
            if (status != COLLIDE_TOO_MANY) told(space, status);
            return status;
        }, width);
    }
};

// --- robots ----------------------------------------------------------------------------------------------------------------

// A robot among obstacles, from a file of Python's collide.RobotChecker.save.
class Robot : public Owner<collide_robot, collide_robot_free> {
public:
    using Owner::Owner;
    static Robot load(const std::string &path) { return Robot(made(collide_robot_load, path.c_str())); }
    static Robot read(Span<const std::uint8_t> bytes) { return Robot(made(collide_robot_read, bytes.data(), bytes.size())); }
    std::size_t columns() const { return collide_robot_columns(get()); }
    std::size_t around() const { return collide_robot_around(get()); }
    std::string column_name(std::size_t column) const { return text(collide_robot_column_name(get(), column)); }
    // Of a body by its number in rows: -1 - k of body k around.
    std::string body_name(std::int32_t body) const { return text(collide_robot_body_name(get(), body)); }

private:
    static std::string text(const char *name) {
        if (name == nullptr) throw Error(COLLIDE_INVALID_ARGUMENT);
        return name;
    }
};

// Nearest pairs, and their derivatives by the columns, a row each.
struct RobotDistances : Answered<collide_pair> {
    std::vector<double> gradients;
};

// Pairs of many configurations: those of configuration k are starts[k] to starts[k + 1] - 1.
struct RobotPairs : RobotDistances {
    std::vector<std::size_t> starts;
};

// Verdicts COLLIDE_MOTION_..., with times of collisions, NaN of others.
struct RobotMotions : Answered<std::uint8_t> {
    std::vector<double> times;
};

// Scratch memory of questions about a robot, which outlives it; one a thread. Configurations are rows of columns() numbers.
class RobotWorkspace : public Owner<collide_robot_workspace, collide_robot_workspace_free> {
public:
    explicit RobotWorkspace(const Robot &robot)
        : Owner(made(collide_robot_workspace_create, robot.get())), columns_(robot.columns()) {}

    // Bodies around, by their numbers -1 - k, to other poses, for the questions of this workspace.
    void move_around(std::int32_t body, const Pose &X_WB) { move_around({&body, 1}, {&X_WB, 1}); }
    void move_around(Span<const std::int32_t> bodies, Span<const Pose> X_WBs) {
        std::size_t failed = none;
        if (bodies.size() != X_WBs.size()) throw Error(COLLIDE_INVALID_ARGUMENT);
        if (bodies.empty()) return;
        collide_status status = collide_robot_move_around(get(), bodies.data(), bodies.size(), X_WBs.data()->data(), &failed);
        require(status, status == COLLIDE_UNSUPPORTED ? none : failed);
    }
    Pose pose_around(std::int32_t body) const {
        Pose X_WB;
        require(collide_robot_pose_around(get(), body, X_WB.m.data()));
        return X_WB;
    }

    // An object on the link of a body, for the questions of this workspace; its number. touch : bodies not tested against it.
    std::int32_t attach(std::int32_t body, const Compound &object, const Pose &X_LS, double padding = 0.0,
                        Span<const std::int32_t> touch = {}) {
        std::int32_t number = -1;
        require(collide_robot_attach(get(), body, object.get(), X_LS.data(), padding, touch.data(), touch.size(), &number));
        return number;
    }
    void detach(std::int32_t number) { require(collide_robot_detach(get(), number)); }
    // pairs : two numbers each, never tested from now on.
    void allow(Span<const std::int32_t> pairs) { require(collide_robot_allow(get(), pairs.data(), rows(pairs, 2))); }

    Answered<std::uint8_t> collides(Span<const double> configurations) {
        std::size_t n = rows(configurations, columns_);
        return answered<std::uint8_t>(n, [&](auto... out) {
            return collide_robot_collide(get(), configurations.data(), n, out...);
        });
    }
    RobotDistances distances(Span<const double> configurations, double max_distance = infinity,
                             unsigned between = COLLIDE_WITH_AROUND | COLLIDE_AMONG_ROBOT) {
        std::size_t n = rows(configurations, columns_);
        std::vector<double> gradients(configurations.size());
        auto found = answered<collide_pair>(n, [&](collide_pair *pairs, auto... out) {
            return collide_robot_distance(get(), configurations.data(), n, max_distance, between, pairs, gradients.data(),
                                          out...);
        });
        return {std::move(found), std::move(gradients)};
    }
    // All pairs of bodies within a distance.
    RobotPairs near(Span<const double> configurations, double max_distance,
                    unsigned between = COLLIDE_WITH_AROUND | COLLIDE_AMONG_ROBOT) {
        std::size_t n = rows(configurations, columns_), capacity = 16 * n + 64, failed = none;
        RobotPairs found;
        found.starts.resize(n + 1);
        found.statuses.resize(n);
        for (collide_status status = COLLIDE_TOO_MANY; status == COLLIDE_TOO_MANY; capacity *= 4) {
            found.rows.resize(capacity);
            found.gradients.resize(capacity * columns_);
            status = collide_robot_near(get(), configurations.data(), n, max_distance, between, found.rows.data(),
                                        found.gradients.data(), capacity, found.starts.data(), found.statuses.data(), &failed);
            if (status != COLLIDE_TOO_MANY && status != COLLIDE_UNSUPPORTED) require(status, failed);
        }
        found.rows.resize(found.starts[n]);
        found.gradients.resize(found.starts[n] * columns_);
        return found;
    }
    // Straight motions from row to row, proven free or found to collide.
    RobotMotions certify(Span<const double> first, Span<const double> last, double resolution = 1e-3) {
        return motions(collide_robot_certify, first, last, resolution);
    }
    // The same at samples: verdicts 1 of collisions, 0 of others.
    RobotMotions sample(Span<const double> first, Span<const double> last, double resolution = 0.01) {
        return motions(collide_robot_sample, first, last, resolution);
    }

private:
    template <class Function>
    RobotMotions motions(Function ask, Span<const double> first, Span<const double> last, double resolution) {
        std::size_t n = rows(first, columns_);
        if (last.size() != first.size()) throw Error(COLLIDE_INVALID_ARGUMENT);
        std::vector<double> times(n);
        auto found = answered<std::uint8_t>(n, [&](std::uint8_t *verdicts, auto... out) {
            return ask(get(), first.data(), last.data(), n, resolution, verdicts, times.data(), out...);
        });
        return {std::move(found), std::move(times)};
    }
    std::size_t columns_;
};

} // namespace collide

#endif
