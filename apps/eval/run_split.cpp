#include "apps/eval/run_split.h"

#include "apps/common/command_line.h"
#include "core/error.h"
#include "train/train_config.h"

namespace stymo {

Split split_called(const std::string& name) {
    if (name.empty()) return Split::all;
    if (name == "train") return Split::training;
    if (name == "val") return Split::validation;
    if (name == "test") return Split::test;
    fail<UsageError>("--split ", name, ": must be train, val or test");
}

DataConfig split_of_run(const std::filesystem::path& model) {
    const std::filesystem::path folder = std::filesystem::absolute(model).parent_path();
    for (const std::filesystem::path& run : {folder, folder.parent_path().parent_path()})
        if (std::filesystem::exists(run / "config.json"))
            return load_train_config(run / "config.json", {}).data;
    fail<FileError>(
        model.string(),
        ": no config.json of its training run beside it to say how the data was split; give --ids ",
        "in place of --split");
}

}  // namespace stymo
