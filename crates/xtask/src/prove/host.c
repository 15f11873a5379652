/* What the compiled harness runs on, as CBMC sees it: memory, traps, and the meaning of `any`, `assume` and `cover`.
 *
 * Given on the command line: MODULE (the name of wasm2c's module), HARNESS (the function to run), COVERS (cases of a
 * switch over the fingerprints of its covers).
 */
#define WASM_RT_USE_MMAP 0
/* every access is compared with the size of the memory, in the code itself */
#define WASM_RT_MEMCHECK_BOUNDS_CHECK 1
#include "wasm-rt.h"

/* wasm2c reinterprets bits by memcpy. CBMC's memcpy is not exact on parts of floats in every back end (and
 * __builtin_memcpy has no body at all), so each pair of types that occurs has a copy of its own; any other is an error. */
typedef union { float f; uint32_t bits; } word_t;
typedef union { double f; uint64_t bits; } double_word_t;
static uint32_t load4(const uint8_t *s) {
  return (uint32_t)s[0] | (uint32_t)s[1] << 8 | (uint32_t)s[2] << 16 | (uint32_t)s[3] << 24;
}
static uint64_t load8(const uint8_t *s) { return (uint64_t)load4(s) | (uint64_t)load4(s + 4) << 32; }
static void store4(uint8_t *d, uint32_t v) { d[0] = v; d[1] = v >> 8; d[2] = v >> 16; d[3] = v >> 24; }
static void store8(uint8_t *d, uint64_t v) { store4(d, v); store4(d + 4, v >> 32); }
static void f32_of_bits(float *d, const uint32_t *s) { word_t w; w.bits = *s; *d = w.f; }
static void bits_of_f32(uint32_t *d, const float *s) { word_t w; w.f = *s; *d = w.bits; }
static void f64_of_bits(double *d, const uint64_t *s) { double_word_t w; w.bits = *s; *d = w.f; }
static void bits_of_f64(uint64_t *d, const double *s) { double_word_t w; w.f = *s; *d = w.bits; }
static void load_f32(float *d, const uint8_t *s) { uint32_t v = load4(s); f32_of_bits(d, &v); }
static void load_f64(double *d, const uint8_t *s) { uint64_t v = load8(s); f64_of_bits(d, &v); }
static void load_u64(uint64_t *d, const uint8_t *s) { *d = load8(s); }
static void load_u32(uint32_t *d, const uint8_t *s) { *d = load4(s); }
static void load_s32(int32_t *d, const uint8_t *s) { *d = (int32_t)load4(s); }
static void load_u16(uint16_t *d, const uint8_t *s) { *d = (uint16_t)(s[0] | s[1] << 8); }
static void load_s16(int16_t *d, const uint8_t *s) { *d = (int16_t)(s[0] | s[1] << 8); }
static void load_s8(int8_t *d, const uint8_t *s) { *d = (int8_t)s[0]; }
static void store_f32(uint8_t *d, const float *s) { uint32_t v; bits_of_f32(&v, s); store4(d, v); }
static void store_f64(uint8_t *d, const double *s) { uint64_t v; bits_of_f64(&v, s); store8(d, v); }
static void store_u64(uint8_t *d, const uint64_t *s) { store8(d, *s); }
static void store_u32(uint8_t *d, const uint32_t *s) { store4(d, *s); }
static void store_u16(uint8_t *d, const uint16_t *s) { d[0] = *s; d[1] = *s >> 8; }
/* One byte; data segments, which come here too, are in data.c. CBMC's _Generic does not tell const apart. */
static void copy_u8(uint8_t *d, const uint8_t *s, uint64_t n) { if (n == 1) *d = *s; }
static void no_such_copy(void) { __CPROVER_assert(0, "a copy between types that host.c does not know"); }
#undef wasm_rt_memcpy
#define wasm_rt_memcpy(d, s, n) \
  _Generic((d), \
    float *: _Generic((s), uint8_t *: load_f32((void *)(d), (void *)(s)), uint32_t *: f32_of_bits((void *)(d), (void *)(s)), default: no_such_copy()), \
    double *: _Generic((s), uint8_t *: load_f64((void *)(d), (void *)(s)), uint64_t *: f64_of_bits((void *)(d), (void *)(s)), default: no_such_copy()), \
    uint32_t *: _Generic((s), uint8_t *: load_u32((void *)(d), (void *)(s)), float *: bits_of_f32((void *)(d), (void *)(s)), default: no_such_copy()), \
    uint64_t *: _Generic((s), uint8_t *: load_u64((void *)(d), (void *)(s)), double *: bits_of_f64((void *)(d), (void *)(s)), default: no_such_copy()), \
    int32_t *: _Generic((s), uint8_t *: load_s32((void *)(d), (void *)(s)), default: no_such_copy()), \
    uint16_t *: _Generic((s), uint8_t *: load_u16((void *)(d), (void *)(s)), default: no_such_copy()), \
    int16_t *: _Generic((s), uint8_t *: load_s16((void *)(d), (void *)(s)), default: no_such_copy()), \
    int8_t *: _Generic((s), uint8_t *: load_s8((void *)(d), (void *)(s)), default: no_such_copy()), \
    uint8_t *: _Generic((s), \
      uint8_t *: copy_u8((void *)(d), (const void *)(s), (n)), const uint8_t *: copy_u8((void *)(d), (const void *)(s), (n)), \
      uint16_t *: store_u16((void *)(d), (void *)(s)), uint32_t *: store_u32((void *)(d), (void *)(s)), \
      uint64_t *: store_u64((void *)(d), (void *)(s)), float *: store_f32((void *)(d), (void *)(s)), \
      double *: store_f64((void *)(d), (void *)(s)), default: no_such_copy()), \
    default: no_such_copy())

#include "harness.c"

WASM_RT_THREAD_LOCAL uint32_t wasm_rt_call_stack_depth;
bool wasm_rt_is_initialized(void) { return true; }

/* The linker puts the stack first, then data. data.c says how large the memory is and gives it its data segments from the
 * start, which spares CBMC a loop over every byte; guards.rs asks whether they are there. What lies beyond this array is
 * out of bounds: an access there, or a data segment that does not fit, is reported. */
#include "data.c"
void wasm_rt_allocate_memory(wasm_rt_memory_t *m, uint64_t pages, uint64_t most, bool is64, uint32_t page_size) {
  m->data = memory; m->data_end = memory + MEMORY; m->page_size = page_size; m->pages = pages; m->max_pages = most;
  m->size = MEMORY; m->is64 = is64;
}
static wasm_rt_funcref_t functions[64];
void wasm_rt_allocate_funcref_table(wasm_rt_funcref_table_t *t, uint32_t count, uint32_t most) {
  __CPROVER_assert(count <= 64, "the table of functions fits");
  t->data = functions; t->size = count; t->max_size = most;
}
uint64_t wasm_rt_grow_memory(wasm_rt_memory_t *m, uint64_t pages) {
  __CPROVER_assert(0, "the memory does not grow");
  return 0xffffffffu;
}

/* The end of the path: what comes after a trap is not looked at. */
void wasm_rt_trap(wasm_rt_trap_t code) {
  __CPROVER_assert(code != WASM_RT_TRAP_UNREACHABLE, "panic");
  __CPROVER_assert(code != WASM_RT_TRAP_OOB, "access out of bounds");
  __CPROVER_assert(code != WASM_RT_TRAP_INT_OVERFLOW, "integer overflow");
  __CPROVER_assert(code != WASM_RT_TRAP_DIV_BY_ZERO, "integer division by zero");
  __CPROVER_assert(code != WASM_RT_TRAP_INVALID_CONVERSION, "conversion of no number");
  __CPROVER_assert(code != WASM_RT_TRAP_EXHAUSTION, "call stack exhausted");
  __CPROVER_assert(code >= WASM_RT_TRAP_OOB && code <= WASM_RT_TRAP_UNREACHABLE || code == WASM_RT_TRAP_EXHAUSTION, "another trap");
  __CPROVER_assume(0);
}

float nondet_float(void);
double nondet_double(void);
uint64_t nondet_uint64_t(void);
float w2c_k_any_f32(struct w2c_k *k) { return nondet_float(); }
double w2c_k_any_f64(struct w2c_k *k) { return nondet_double(); }
uint64_t w2c_k_any_u64(struct w2c_k *k) { return nondet_uint64_t(); }
void w2c_k_assume(struct w2c_k *k, uint32_t condition) { __CPROVER_assume(condition); }
/* A cover is reached where its assertion fails. */
void w2c_k_cover(struct w2c_k *k, uint32_t fingerprint, uint32_t condition) {
  if (condition) {
    switch (fingerprint) {
      COVERS
      default: __CPROVER_assert(0, "a cover that the source does not name");
    }
  }
}

static w2c_harness module;
int main(void) {
  wasm2c_harness_instantiate(&module, 0);
  HARNESS(&module);
  __CPROVER_assert(0, "cover: the end");
  return 0;
}
