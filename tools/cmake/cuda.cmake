# SPDX-License-Identifier: MIT
# Finds nvcc, as PADDER_CUDA wants it, and sets padder_with_cuda. Included by the top level: a language that a folder
# below enables is not known beside it.
set(padder_with_cuda OFF)
if(NOT PADDER_CUDA STREQUAL "OFF")
  include(CheckLanguage)
  if(NOT CMAKE_CUDA_COMPILER AND NOT DEFINED ENV{CUDACXX})
    find_program(padder_nvcc nvcc PATHS /usr/local/cuda/bin)
    if(padder_nvcc)
      set(CMAKE_CUDA_COMPILER ${padder_nvcc})
    endif()
  endif()
  # PTX for compute capability 8.0, which the driver compiles for any GPU since then, and machine code for 9.0. The preset
  # `release` has machine code for the others, too: their first call then starts at once, and building takes longer.
  if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
    set(CMAKE_CUDA_ARCHITECTURES 80-virtual 90-real)
  endif()
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    enable_language(CUDA)
    if(NOT CMAKE_CUDA20_STANDARD_COMPILE_OPTION)  # CMake before 3.26 does not know this of newer toolkits
      set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION "-std=c++20")
      set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION "-std=c++20")
    endif()
    set(padder_with_cuda ON)
  elseif(PADDER_CUDA STREQUAL "ON")
    message(FATAL_ERROR "PADDER_CUDA=ON, but no CUDA compiler was found: put nvcc on the PATH or set CMAKE_CUDA_COMPILER")
  endif()
endif()
