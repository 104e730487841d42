# arm-none-eabi-gcc for an MPS2 board: -DMPS2_BOARD=an386 (Cortex-M4F, the default) or an500 (Cortex-M7).
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY) # an executable would need the board's start-up code
set(MPS2_BOARD an386 CACHE STRING "an386 or an500")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES MPS2_BOARD)
if(MPS2_BOARD STREQUAL "an386")
  set(cpu "-mcpu=cortex-m4 -mfpu=fpv4-sp-d16")
elseif(MPS2_BOARD STREQUAL "an500")
  set(cpu "-mcpu=cortex-m7 -mfpu=fpv5-d16")
else()
  message(FATAL_ERROR "MPS2_BOARD is ${MPS2_BOARD}; the port knows an386 and an500")
endif()
# Nobody reads errno after a square root; without it the C library's per-thread data stays out of the image.
set(CMAKE_C_FLAGS_INIT "${cpu} -mthumb -mfloat-abi=hard -fno-math-errno -ffunction-sections -fdata-sections")
set(CMAKE_C_FLAGS_RELEASE "-O2" CACHE STRING "as the figures in the headers were measured")
