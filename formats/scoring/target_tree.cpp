// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/target_tree.h"

#include <algorithm>
#include <numeric>

namespace sonocase {

TargetTree::TargetTree(std::span<const Target> targets)
    : targets_(targets), done_(targets.size(), false) {
    order_.resize(targets.size());
    std::iota(order_.begin(), order_.end(), 0u);
    if (!targets.empty()) build(0, static_cast<std::uint32_t>(targets.size()));
}

int TargetTree::build(std::uint32_t first, std::uint32_t count) {
    constexpr std::uint32_t kLeaf = 8;
    const int at = static_cast<int>(nodes_.size());
    nodes_.emplace_back();
    Box3 box;
    for (std::uint32_t i = first; i < first + count; ++i) box.include(targets_[order_[i]].centre);
    Node node;
    node.centre = box.centre();
    for (std::uint32_t i = first; i < first + count; ++i) {
        const Target& target = targets_[order_[i]];
        const double reach = std::max(target.radius_mm, target.hit_radius_mm);
        node.radius = std::max(node.radius, distance(node.centre, target.centre) + reach);
    }
    node.first = first;
    node.count = node.open = count;
    if (count > kLeaf) {
        const Vector3 extent = box.extent();
        const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0
                         : extent.y >= extent.z                       ? 1
                                                                      : 2;
        const auto from = order_.begin() + first;
        std::nth_element(
            from, from + count / 2, from + count, [&](std::uint32_t a, std::uint32_t b) {
                const double x = targets_[a].centre[axis], y = targets_[b].centre[axis];
                return x != y ? x < y : a < b;
            });
        node.left = build(first, count / 2);
        node.right = build(first + count / 2, count - count / 2);
    }
    nodes_[at] = node;
    return at;
}

}  // namespace sonocase
