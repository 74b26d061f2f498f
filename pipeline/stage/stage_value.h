// SPDX-License-Identifier: Apache-2.0

// The result of a stage, of whatever type, as it goes from stage to stage.
//
// Copies share the result. A stage names the type when it reads one: value.as<LabelFile>(). Reading
// another type than was stored is a mistake in a stage's descriptor and throws std::bad_any_cast.
#pragma once

#include <any>
#include <memory>
#include <utility>

namespace sonocase::pipeline {

class StageValue {
  public:
    template <class T>
    static StageValue of(T value) {
        StageValue result;
        result.value_ = std::make_shared<std::any>(std::move(value));
        return result;
    }

    explicit operator bool() const { return value_ != nullptr; }

    template <class T>
    const T& as() const {
        return std::any_cast<const T&>(*value_);
    }
    // Moves the result out; other copies of the StageValue must no longer be read.
    template <class T>
    T take() {
        return std::any_cast<T&&>(std::move(*value_));
    }

  private:
    std::shared_ptr<std::any> value_;
};

}  // namespace sonocase::pipeline
