// SPDX-License-Identifier: Apache-2.0

// A tree of balls over targets: a search skips whole branches of targets that are not near.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/exercise/exercise.h"

namespace sonocase {

class TargetTree {
  public:
    // The targets must outlive the tree.
    explicit TargetTree(std::span<const Target> targets);

    // keep(centre, radius) returns whether a ball may contain a match; visit(index) is called for
    // each target in such balls. A target is offered in later searches until visit returns true.
    template <class Keep, class Visit>
    void search(Keep keep, Visit visit) {
        if (!nodes_.empty()) search(0, keep, visit);
    }
    bool empty() const { return nodes_.empty() || nodes_[0].open == 0; }

  private:
    struct Node {
        Point3 centre;
        double radius = 0;
        std::uint32_t first = 0, count = 0;  // of order_
        std::int32_t left = -1, right = -1;
        std::uint32_t open = 0;  // targets still offered
    };
    int build(std::uint32_t first, std::uint32_t count);
    template <class Keep, class Visit>
    std::uint32_t search(int at, Keep& keep, Visit& visit) {
        Node& node = nodes_[at];
        if (node.open == 0 || !keep(node.centre, node.radius)) return node.open;
        if (node.left < 0) {
            for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
                if (done_[i]) continue;
                done_[i] = visit(order_[i]);
                if (done_[i]) --node.open;
            }
        } else {
            node.open = search(node.left, keep, visit) + search(node.right, keep, visit);
        }
        return node.open;
    }

    std::span<const Target> targets_;
    std::vector<std::uint32_t> order_;
    std::vector<bool> done_;
    std::vector<Node> nodes_;
};

}  // namespace sonocase
