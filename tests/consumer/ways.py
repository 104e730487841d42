"""Take the library along in every way that is offered, and run a program each time.

python ways.py SOURCE BUILD WORK. BUILD is the build directory of the library, WORK a directory of this check's own.
Ways: installed with pkg-config, in two files (C, C++, Microsoft's rules), a block of Simulink, a module of Zephyr, a
component of ESP-IDF, a library of PlatformIO, Conan's recipe, vcpkg's port. Where the tool itself is not there, its
functions are stood in for by those that its documentation describes: the sources, include folders, definitions and
flags that a recipe names are used, the files that it copies are copied. Only the two files are compiled once more;
a recipe that names the very sources and flags gets BUILD's library.
"""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import types
from pathlib import Path

SOURCE, BUILD, WORK = (Path(a).resolve() for a in sys.argv[1:4])
HERE = Path(__file__).resolve().parent
USE = HERE / "use.c"
VERSION = ".".join(
    re.findall(
        r"#define AEO_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", (SOURCE / "include/aeolid/aeolid.h").read_text("utf-8")
    )
)
SOURCES = {p.name for p in (SOURCE / "src").glob("*.c")}
FLAGS = {"-ffp-contract=off", "-fno-math-errno"}
EXPECTED = {4: "Xi = [0.5000 -0.2500]", 8: "Xi = [0.5000 -0.2500]"}  # use.c on y_k = u/2 - y/4, by bytes of a number


def run(*command: object, **options: object) -> str:
    """Run a command and return its output; end the check when it fails."""
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload]
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return str(done.stdout)


def demand(holds: bool, said: str) -> None:
    """End the check with a sentence unless something holds."""
    if not holds:
        sys.exit(said)


def try_program(name: str, *words: object, size: int = 4) -> None:
    """Compile and link use.c with what a way gives, and run it."""
    program = WORK / f"use_{name}"
    run("gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", USE, *words, "-lm", "-o", program)
    said = run(program)
    demand(said == f"done: {size}-byte numbers, {EXPECTED[size]}\n", f"{name}: the program says {said!r}")
    print(f"{name}: {said}", end="")


def install() -> Path:
    """Install BUILD for development; what is promised is there."""
    prefix = WORK / "installed"
    run("cmake", "--install", BUILD, "--prefix", prefix, "--component", "development")
    for part in ("share/doc/aeolid/LICENSE", "share/aeolid/aeolid.dbc", "share/aeolid/port/template/port_template.c"):
        demand((prefix / part).is_file(), f"{part} is not installed")
    return prefix


def take_by_pkg_config(prefix: Path) -> None:
    """Compile with the words of pkg-config, in both precisions."""
    if shutil.which("pkg-config") is None:
        print("pkg-config: skipped, it is not installed")
        return
    places = ":".join(str(p.parent) for p in prefix.rglob("*.pc"))
    for name, size in (("aeolid", 4), ("aeolid_double", 8)):
        # the files name the prefix that was configured; pkg-config moves it to where they are
        words = ["pkg-config", "--define-variable", f"prefix={prefix}", "--cflags", "--libs", name]
        try_program(name, *run(*words, env={**os.environ, "PKG_CONFIG_PATH": places}).split(), size=size)
        version = run("pkg-config", "--modversion", name, env={**os.environ, "PKG_CONFIG_PATH": places}).strip()
        demand(version == VERSION, f"{name}.pc says version {version}")


def take_two_files() -> None:
    """Compile the two files as C, whose program counts to the same bits as the library, and as C++."""
    folder = WORK / "two_files"
    run(sys.executable, SOURCE / "tools/amalgamate.py", folder)
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Werror"]
    run("gcc", "-std=c99", "-O1", *FLAGS, *strict, "-c", folder / "aeolid.c", "-o", folder / "aeolid.o")
    for precision in ([], ["-DAEO_REAL_DOUBLE"]):
        run("g++", "-x", "c++", "-std=c++11", "-fsyntax-only", *precision, folder / "aeolid.c")
    digest, family = SOURCE / "tests/firmware/digest.c", SOURCE / "tests/family"
    around = [f"-I{SOURCE / 'include'}", f"-I{SOURCE / 'tests/firmware'}", f"-I{family}", digest, family / "family.c"]
    around += [SOURCE / "tests/firmware" / name for name in ("pc.c", "text.c")]
    said = []
    for name, library in (("two", folder / "aeolid.o"), ("one", BUILD / "libaeolid.a")):
        run("gcc", "-std=c99", "-O1", *FLAGS, *around, library, "-lm", "-o", WORK / f"digest_{name}")
        said.append(run(WORK / f"digest_{name}"))
    demand(said[0] == said[1] and len(said[0]) > 100, "the two files give other bits than the library")
    take_by_msvc_rules(folder / "aeolid.c")
    text = re.sub(r"#include <aeolid/\w+\.h>\n", "", USE.read_text("utf-8"))
    (folder / "use.c").write_text('#include "aeolid.h"\n' + text, "utf-8")
    run("gcc", "-std=c99", *strict, "-c", folder / "use.c", "-o", folder / "use.o")


def take_by_msvc_rules(source: Path) -> None:
    """Compile as C and C++ for Windows, with Microsoft's extensions and without a C library, where clang is."""
    if shutil.which("clang") is None:
        print("MSVC's rules: skipped, clang is not installed")
        return
    windows = ["--target=x86_64-pc-windows-msvc", "-fms-compatibility", "-fms-extensions"]
    for dialect in (["-x", "c", "-std=c11"], ["-x", "c++", "-std=c++14"]):
        here = ["-ffreestanding", f"-I{SOURCE / 'tests/firmware/bare'}", "-fsyntax-only"]
        run("clang", *windows, *dialect, *here, source)


def take_into_simulink() -> None:
    """A C Caller block's functions, with the library's headers and with the two files; the S-function around them."""
    folder, two = SOURCE / "examples/simulink", WORK / "two_files"
    block = ["-std=c99", "-Wall", "-Wextra", "-Werror", f"-I{folder}", HERE / "simulink.c", folder / "aeolid_block.c"]
    ways = {
        "headers": [f"-I{SOURCE / 'include'}", BUILD / "libaeolid.a"],
        "two": ["-DAEOLID_TWO_FILES", f"-I{two}", two / "aeolid.o"],
    }
    for name, words in ways.items():
        run("gcc", *block, *words, "-lm", "-o", WORK / f"block_{name}")
        print(run(WORK / f"block_{name}"), end="")
    stand_in = [*block[:4], f"-I{folder}", f"-I{HERE / 'simulink'}"]
    sources = [folder / "aeolid_sfun.c", folder / "aeolid_block.c", f"-I{two}", two / "aeolid.o"]
    run("gcc", *stand_in, "-DMATLAB_MEX_FILE", "-DAEOLID_TWO_FILES", *sources, "-lm", "-o", WORK / "sfun")
    print(run(WORK / "sfun"), end="")
    # generated code registers the methods by a header of the coder; here nothing calls them
    run("gcc", *stand_in, "-Wno-unused-function", "-fsyntax-only", folder / "aeolid_sfun.c")


def read_way(name: str, text: str) -> dict[str, list[str]]:
    """Run a build file with its tool stood in for; returns the sources, includes, definitions and options it named."""
    folder = WORK / name
    folder.mkdir(parents=True, exist_ok=True)
    tell = "".join(f'message(NOTICE "{k}=${{WAY_{k}}}")\n' for k in ("SOURCES", "INCLUDES", "DEFINITIONS", "OPTIONS"))
    (folder / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.20)\nproject({name} LANGUAGES C)\n{text}\n{tell}", "utf-8"
    )
    done = subprocess.run(
        ["cmake", "-S", folder, "-B", folder / "build", "-G", "Ninja"], capture_output=True, text=True, check=False
    )
    demand(done.returncode == 0, f"{name}: {done.stderr}")
    found = dict(re.findall(r"^(SOURCES|INCLUDES|DEFINITIONS|OPTIONS)=(.*)$", done.stderr, re.M))
    return {key: [v for v in value.split(";") if v] for key, value in found.items()}


def judge_way(name: str, found: dict[str, list[str]], *, double: bool = False) -> None:
    """A way that names the very sources and flags gets the library made of them, and its includes must do."""
    demand({Path(p).name for p in found["SOURCES"]} == SOURCES, f"{name}: other sources than src/*.c")
    demand(set(found["OPTIONS"]) == FLAGS, f"{name}: options {found['OPTIONS']}")
    demand(all(Path(p).is_file() for p in found["SOURCES"]), f"{name}: a source that is not there")
    words = [*(f"-I{p}" for p in found["INCLUDES"]), *(f"-D{d}" for d in found.get("DEFINITIONS", []))]
    try_program(name, *words, BUILD / ("libaeolid_double.a" if double else "libaeolid.a"), size=8 if double else 4)


def take_by_zephyr() -> None:
    """The module's file, with the options that Kconfig declares; off, it builds nothing."""
    declared = set(re.findall(r"^(?:menu)?config (\w+)", (SOURCE / "zephyr/Kconfig").read_text("utf-8"), re.M))
    used = set(re.findall(r"CONFIG_(\w+)", (SOURCE / "zephyr/CMakeLists.txt").read_text("utf-8")))
    demand(declared == used, f"zephyr: Kconfig declares {declared}, the build uses {used}")
    stand_in = f"include({HERE / 'zephyr.cmake'})\n"
    module = f"include({SOURCE / 'zephyr/CMakeLists.txt'})\n"
    demand(not read_way("zephyr_off", stand_in + module)["SOURCES"], "zephyr: builds although it is off")
    judge_way("zephyr", read_way("zephyr", f"{stand_in}set(CONFIG_AEOLID y)\n{module}"))
    both = "set(CONFIG_AEOLID y)\nset(CONFIG_AEOLID_DOUBLE y)\n"
    judge_way("zephyr_double", read_way("zephyr_double", f"{stand_in}{both}{module}"), double=True)


def take_by_esp_idf() -> None:
    """The component that the root's file registers under ESP_PLATFORM."""
    stand_in = """
        macro(idf_component_register)
            cmake_parse_arguments(WAY "" "" "SRCS;INCLUDE_DIRS" ${ARGN})
            set(WAY_SOURCES ${WAY_SRCS})
            foreach(folder ${WAY_INCLUDE_DIRS})
                list(APPEND WAY_INCLUDES ${CMAKE_CURRENT_LIST_DIR}/${folder})
            endforeach()
            set(COMPONENT_LIB component)
            add_library(component INTERFACE)
        endmacro()
        macro(target_compile_options target scope)
            set(WAY_OPTIONS ${ARGN})
        endmacro()
        set(ESP_PLATFORM 1)
    """
    manifest = (SOURCE / "idf_component.yml").read_text("utf-8")
    demand(f'version: "{VERSION}"' in manifest, "idf_component.yml: another version")
    judge_way("esp_idf", read_way("esp_idf", f"{stand_in}\ninclude({SOURCE / 'CMakeLists.txt'})"))


def take_by_platformio() -> None:
    """The manifest's folders and flags; what it exports is there."""
    manifest = json.loads((SOURCE / "library.json").read_text("utf-8"))
    build, shipped = manifest["build"], manifest["export"]["include"]
    demand(manifest["version"] == VERSION, "library.json: another version")
    narrow = {"*", "atmelavr", "atmelmegaavr", "timsp430", "intel_mcs51", "ststm8"}  # which config.h refuses
    demand(not narrow & set(manifest["platforms"]), "library.json names platforms of 8 or 16 bits")
    demand(all((SOURCE / part).exists() for part in shipped), "library.json exports what is not there")
    found = {
        "SOURCES": [str(p) for p in (SOURCE / build["srcDir"]).glob("*.c")],
        "INCLUDES": [str(SOURCE / build["includeDir"])],
        "OPTIONS": build["flags"],
    }
    judge_way("platformio", found)


def stand_in_for_conan() -> None:
    """Let `from conan import …` find what the recipe calls: cmake itself, and a copy of files."""

    class CMake:
        def __init__(self, recipe: object) -> None:
            self.recipe = recipe

        def configure(self) -> None:
            run("cmake", "-S", self.recipe.export_sources_folder, "-B", WORK / "conan_build", "-DAEOLID_PORTS=OFF")  # type: ignore[attr-defined]

    def copy(_: object, pattern: str, source: str, target: str) -> None:
        for path in sorted(Path(source).glob(pattern.replace("/*", "/**/*"))):
            if path.is_file():
                place = Path(target) / path.relative_to(source)
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, place)

    modules = {
        "conan": {"ConanFile": object},
        "conan.tools": {},
        "conan.tools.cmake": {"CMake": CMake, "CMakeToolchain": None, "cmake_layout": None},
        "conan.tools.files": {"copy": copy, "load": lambda _, path: Path(path).read_text("utf-8")},
    }
    for name, members in modules.items():
        sys.modules[name] = types.ModuleType(name)
        sys.modules[name].__dict__.update(members)


def take_by_conan() -> None:
    """The recipe finds the version, exports what a configuration needs, and names library and definitions."""
    stand_in_for_conan()
    path = SOURCE / "packaging/conan/conanfile.py"
    spec = importlib.util.spec_from_file_location("conanfile", path)
    demand(spec is not None and spec.loader is not None, "conanfile.py cannot be loaded")
    module = importlib.util.module_from_spec(spec)  # type: ignore[arg-type]
    spec.loader.exec_module(module)  # type: ignore[union-attr]
    recipe = module.Aeolid()
    recipe.recipe_folder, recipe.export_sources_folder = str(path.parent), str(WORK / "conan_sources")
    recipe.set_version()
    demand(recipe.version == VERSION, f"conan: version {recipe.version}")
    recipe.export_sources()
    recipe.build_folder = str(WORK)
    module.CMake(recipe).configure()
    for precision in ("float", "double"):
        recipe.options = types.SimpleNamespace(precision=precision)
        recipe.settings = types.SimpleNamespace(os="Linux")
        recipe.cpp_info = types.SimpleNamespace(set_property=lambda *_: None)
        recipe.package_info()
        info = recipe.cpp_info
        words = [f"-I{WORK / 'conan_sources/include'}", *(f"-D{d}" for d in info.defines)]
        try_program(f"conan_{precision}", *words, BUILD / f"lib{info.libs[0]}.a", size=8 if info.defines else 4)


def take_by_vcpkg(prefix: Path) -> None:
    """The port's script, with vcpkg's functions stood in for by cmake's own commands."""
    port = SOURCE / "packaging/vcpkg/aeolid"
    demand(json.loads((port / "vcpkg.json").read_text("utf-8"))["version"] == VERSION, "vcpkg.json: another version")
    script = WORK / "vcpkg.cmake"
    script.write_text(
        f"""
        macro(vcpkg_check_linkage)
        endmacro()
        function(vcpkg_cmake_configure)
            cmake_parse_arguments(A "" "SOURCE_PATH" "OPTIONS" ${{ARGN}})
            execute_process(COMMAND cmake -S ${{A_SOURCE_PATH}} -B {WORK}/vcpkg_build ${{A_OPTIONS}} OUTPUT_QUIET
                COMMAND_ERROR_IS_FATAL ANY)
        endfunction()
        function(vcpkg_cmake_install)
        endfunction()
        function(vcpkg_cmake_config_fixup)
            cmake_parse_arguments(A "" "PACKAGE_NAME;CONFIG_PATH" "" ${{ARGN}})
            file(GLOB_RECURSE found {prefix}/*/cmake/${{A_PACKAGE_NAME}}/aeolidConfig.cmake)
            if(NOT found MATCHES "${{A_CONFIG_PATH}}|lib/.*/cmake/aeolid")
                message(FATAL_ERROR "no configuration in ${{A_CONFIG_PATH}}")
            endif()
        endfunction()
        function(vcpkg_fixup_pkgconfig)
        endfunction()
        function(vcpkg_install_copyright)
            cmake_parse_arguments(A "" "" "FILE_LIST" ${{ARGN}})
            if(NOT EXISTS ${{A_FILE_LIST}})
                message(FATAL_ERROR "no licence")
            endif()
        endfunction()
        set(CURRENT_PACKAGES_DIR {WORK}/vcpkg_packages)
        include({port}/portfile.cmake)
        """,
        "utf-8",
    )
    run("cmake", "-P", script)
    print("vcpkg: the port configures")


def main() -> None:
    """Take the library along in each way."""
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    prefix = install()
    take_by_pkg_config(prefix)
    take_two_files()
    take_into_simulink()
    take_by_zephyr()
    take_by_esp_idf()
    take_by_platformio()
    take_by_conan()
    take_by_vcpkg(prefix)


if __name__ == "__main__":
    main()
