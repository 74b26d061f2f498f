// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/label_tree.h"

#include <algorithm>
#include <functional>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline segmentation {
namespace {

// Contact area of each pair of labels, in thousandths of the largest voxel face; the diagonal marks
// the labels that are present. Integers, such that the sum does not depend on its order.
std::vector<std::int64_t> contact_areas(const LabelVolume& volume) {
    const Grid& g = volume.grid;
    const std::size_t n = volume.labels.size();
    const Vector3 h = g.spacing_mm;
    const double face[3] = {h.y * h.z, h.z * h.x, h.x * h.y};
    const double largest = std::max({face[0], face[1], face[2]});
    std::int64_t unit[3];
    for (int a = 0; a < 3; ++a)
        unit[a] = std::max<std::int64_t>(1, static_cast<std::int64_t>(1000 * face[a] / largest));
    const std::size_t step[3] = {1, static_cast<std::size_t>(g.size.x),
                                 static_cast<std::size_t>(g.size.x) * g.size.y};
    constexpr std::size_t kPieces = 16;
    std::vector<std::vector<std::int64_t>> partial(kPieces);
    parallel_for(kPieces, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t piece = begin; piece < end; ++piece) {
            auto& area = partial[piece];
            area.assign(n * n, 0);
            const auto depth = static_cast<std::size_t>(g.size.z);
            const int first = static_cast<int>(depth * piece / kPieces);
            const int last = static_cast<int>(depth * (piece + 1) / kPieces);
            for (int k = first; k < last; ++k) {
                for (int j = 0; j < g.size.y; ++j) {
                    const std::uint8_t* at = volume.voxels.data() + g.index(0, j, k);
                    for (int i = 0; i < g.size.x; ++i, ++at) {
                        const std::size_t own = *at;
                        area[own * n + own] = 1;
                        const bool more[3] = {i + 1 < g.size.x, j + 1 < g.size.y, k + 1 < g.size.z};
                        for (int a = 0; a < 3; ++a) {
                            if (!more[a] || at[step[a]] == own) continue;
                            const std::size_t other = at[step[a]];
                            area[std::min(own, other) * n + std::max(own, other)] += unit[a];
                        }
                    }
                }
            }
        }
    });
    std::vector<std::int64_t> sum(n * n, 0);
    for (const auto& area : partial) {
        for (std::size_t e = 0; e < sum.size(); ++e) sum[e] += area[e];
    }
    return sum;
}

using Contact = std::function<std::int64_t(std::size_t, std::size_t)>;

// Prim's algorithm: the label with the largest contact to a label of the tree is added next. All
// labels of a grid are connected; a label without contact would be added below the root.
// Returns the labels in the order in which they were added, parents before children.
std::vector<std::size_t> grow_tree(const std::vector<bool>& present,
                                   const Contact& contact,
                                   LabelTree* tree) {
    const std::size_t n = present.size();
    std::vector<std::int64_t> best(n, -1);
    std::vector<std::size_t> from(n, 0), order;
    for (std::size_t l = 0; l < n; ++l) {
        if (!present[l]) continue;
        if (order.empty()) {
            order.push_back(l);
            tree->parent[l] = LabelTree::kRoot;
        } else {
            best[l] = 0;
            from[l] = order[0];
        }
    }
    while (!order.empty()) {
        const std::size_t last = order.back();
        std::size_t next = n;
        for (std::size_t l = 0; l < n; ++l) {
            if (best[l] < 0) continue;
            if (contact(last, l) > best[l]) {
                best[l] = contact(last, l);
                from[l] = last;
            }
            if (next == n || best[l] > best[next]) next = l;
        }
        if (next == n) break;
        best[next] = -1;
        tree->parent[next] = static_cast<int>(from[next]);
        for (const std::size_t l : order) {
            const auto steps = static_cast<std::uint8_t>(tree->steps[from[next] * n + l] + 1);
            tree->steps[next * n + l] = tree->steps[l * n + next] = steps;
        }
        order.push_back(next);
    }
    return order;
}

// Labels on the path between others that touch, by more than a small share of their own surface.
std::vector<bool> labels_between(const LabelTree& tree, const Contact& contact) {
    const std::size_t n = tree.parent.size();
    std::vector<std::int64_t> through(n, 0), own(n, 0);
    for (std::size_t a = 0; a < n; ++a) {
        for (std::size_t b = a + 1; b < n; ++b) {
            if (contact(a, b) == 0) continue;
            own[a] += contact(a, b);
            own[b] += contact(a, b);
            for (std::size_t l = 0; l < n && tree.steps_between(a, b) > 1; ++l) {
                if (l != a && l != b && tree.parent[l] != LabelTree::kAbsent &&
                    tree.steps_between(a, l) + tree.steps_between(l, b) == tree.steps_between(a, b))
                    through[l] += contact(a, b);
            }
        }
    }
    constexpr double kShare = 0.02;  // less is noise
    std::vector<bool> between(n);
    for (std::size_t l = 0; l < n; ++l)
        between[l] = static_cast<double>(through[l]) > kShare * static_cast<double>(own[l]);
    return between;
}

}  // namespace

LabelTree nest_labels(const LabelVolume& volume) {
    const std::size_t n = volume.labels.size();
    const std::vector<std::int64_t> area = contact_areas(volume);
    const auto contact = [&](std::size_t a, std::size_t b) {
        return area[std::min(a, b) * n + std::max(a, b)];
    };
    std::vector<bool> present(n);
    for (std::size_t l = 0; l < n; ++l) present[l] = area[l * n + l] != 0;
    LabelTree tree;
    tree.parent.assign(n, LabelTree::kAbsent);
    tree.members.resize(n);
    tree.steps.assign(n * n, 0);
    const std::vector<std::size_t> order = grow_tree(present, contact, &tree);
    for (std::size_t o = order.size(); o-- > 0;) {
        const std::size_t l = order[o];
        tree.members[l].set(l);
        if (tree.parent[l] >= 0) tree.members[tree.parent[l]] |= tree.members[l];
    }
    tree.between = labels_between(tree, contact);
    return tree;
}

}  // namespace sonocase::pipeline::inline segmentation
