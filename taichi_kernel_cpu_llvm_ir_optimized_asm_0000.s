	.text
	.file	"kernel"
	.section	.rodata.cst16,"aM",@progbits,16
	.p2align	4
.LCPI0_0:
	.long	0
	.long	2
	.long	1
	.long	1
	.text
	.globl	r_c80_0_kernel_0_range_for
	.p2align	4, 0x90
	.type	r_c80_0_kernel_0_range_for,@function
r_c80_0_kernel_0_range_for:
	subq	$56, %rsp
	movq	%rdi, (%rsp)
	movq	$0, 8(%rsp)
	movq	$1, 32(%rsp)
	leaq	function_body(%rip), %rax
	movq	%rax, 16(%rsp)
	movq	$0, 24(%rsp)
	vmovaps	.LCPI0_0(%rip), %xmm0
	vmovups	%xmm0, 40(%rsp)
	movq	8(%rdi), %rax
	movq	8280(%rax), %rdi
	leaq	cpu_parallel_range_for_task(%rip), %r8
	movq	%rsp, %rcx
	movl	$2, %esi
	movl	$2, %edx
	callq	*8288(%rax)
	addq	$56, %rsp
	retq
.Lfunc_end0:
	.size	r_c80_0_kernel_0_range_for, .Lfunc_end0-r_c80_0_kernel_0_range_for

	.section	.rodata.cst4,"aM",@progbits,4
	.p2align	2
.LCPI1_0:
	.long	0x3e800000
.LCPI1_1:
	.long	0x3f800000
.LCPI1_2:
	.long	0xbf000000
.LCPI1_3:
	.long	0xc1780000
.LCPI1_4:
	.long	0x7fffffff
.LCPI1_5:
	.long	0xbf800000
.LCPI1_6:
	.long	0x41880000
.LCPI1_9:
	.long	0x3f000000
	.section	.rodata.cst32,"aM",@progbits,32
	.p2align	5
.LCPI1_7:
	.long	0x3f000000
	.long	0x3fc00000
	.long	0x40200000
	.long	0x40600000
	.long	0x40900000
	.long	0x40b00000
	.long	0x40d00000
	.long	0x40f00000
.LCPI1_8:
	.long	0x41080000
	.long	0x41180000
	.long	0x41280000
	.long	0x41380000
	.long	0x41480000
	.long	0x41580000
	.long	0x41680000
	.long	0x41780000
	.text
	.p2align	4, 0x90
	.type	function_body,@function
function_body:
	pushq	%rbp
	pushq	%r15
	pushq	%r14
	pushq	%r13
	pushq	%r12
	pushq	%rbx
	subq	$72, %rsp
	imull	$1800, %edx, %ebp
	leal	1800(%rbp), %eax
	cmpl	$3600, %eax
	movl	$3600, %ecx
	cmovll	%eax, %ecx
	movl	%ecx, -120(%rsp)
	cmpl	%ecx, %ebp
	jge	.LBB1_10
	movq	(%rdi), %r10
	vmovss	48(%r10), %xmm1
	vmulss	.LCPI1_0(%rip), %xmm1, %xmm0
	vaddss	.LCPI1_1(%rip), %xmm0, %xmm0
	vbroadcastss	%xmm0, %ymm10
	vbroadcastss	%xmm1, %ymm11
	imull	$57600, %edx, %eax
	movl	%eax, -124(%rsp)
	vbroadcastss	.LCPI1_1(%rip), %ymm2
	vbroadcastss	.LCPI1_4(%rip), %xmm0
	vmovaps	%xmm0, 48(%rsp)
	vxorps	%xmm8, %xmm8, %xmm8
	movl	$15, %r12d
	vmovss	.LCPI1_9(%rip), %xmm31
	movq	%r10, -104(%rsp)
	jmp	.LBB1_2
	.p2align	4, 0x90
.LBB1_9:
	movq	-112(%rsp), %rbp
	incl	%ebp
	addl	$32, -124(%rsp)
	cmpl	-120(%rsp), %ebp
	je	.LBB1_10
.LBB1_2:
	movslq	%ebp, %rax
	imulq	$-1851608123, %rax, %rdx
	shrq	$32, %rdx
	addl	%ebp, %edx
	movl	%edx, %ecx
	shrl	$31, %ecx
	sarl	$10, %edx
	addl	%ecx, %edx
	testl	%eax, %eax
	sets	%cl
	imull	$1800, %edx, %esi
	cmpl	%eax, %esi
	setne	%al
	andb	%cl, %al
	movzbl	%al, %eax
	subl	%eax, %edx
	imull	$2147481848, %edx, %eax
	movq	%rbp, -112(%rsp)
	addl	%ebp, %eax
	leal	(%rdx,%rax,2), %r8d
	movq	8(%r10), %rcx
	movslq	%r8d, %rsi
	movl	(%rcx,%rsi,4), %r14d
	leal	1(%rdx,%rax,2), %eax
	cltq
	movl	(%rcx,%rax,4), %r11d
	movl	%esi, %eax
	shll	$4, %eax
	imulq	$1717986919, %rsi, %rbp
	movq	%rbp, %rcx
	shrq	$63, %rcx
	shrq	$32, %rbp
	sarl	$5, %ebp
	addl	%ecx, %ebp
	testl	%esi, %esi
	sets	%bl
	movl	%ebp, %ecx
	shll	$4, %ecx
	leal	(%rcx,%rcx,4), %ecx
	cmpl	%esi, %ecx
	setne	%r9b
	movq	8(%rdi), %rcx
	movq	88(%rcx), %rsi
	movslq	%eax, %rcx
	movq	%rcx, %rax
	shlq	$6, %rax
	vmovups	%ymm2, (%rsi,%rax)
	vmovups	%ymm2, 32(%rsi,%rax)
	vmovups	%ymm8, 3686400(%rsi,%rax)
	vmovups	%ymm8, 3686432(%rsi,%rax)
	vmovups	%ymm8, 7372800(%rsi,%rax)
	vmovups	%ymm8, 7372832(%rsi,%rax)
	vmovups	%ymm8, 11059200(%rsi,%rax)
	movq	%rax, 24(%rsp)
	vmovups	%ymm8, 11059232(%rsi,%rax)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	1(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, 16(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	2(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, 8(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	3(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, (%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	4(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -8(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	5(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -16(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	6(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -24(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	7(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -32(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	8(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -40(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	9(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -48(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	10(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -56(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	11(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -64(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	12(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -72(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	13(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -80(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	14(%rcx), %esi
	movslq	%esi, %rsi
	shlq	$6, %rsi
	vmovups	%ymm2, (%rax,%rsi)
	vmovups	%ymm2, 32(%rax,%rsi)
	vmovups	%ymm8, 3686400(%rax,%rsi)
	vmovups	%ymm8, 3686432(%rax,%rsi)
	vmovups	%ymm8, 7372800(%rax,%rsi)
	vmovups	%ymm8, 7372832(%rax,%rsi)
	vmovups	%ymm8, 11059200(%rax,%rsi)
	movq	%rsi, -88(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rsi)
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	orl	$15, %ecx
	movslq	%ecx, %rcx
	shlq	$6, %rcx
	vmovups	%ymm2, (%rax,%rcx)
	vmovups	%ymm2, 32(%rax,%rcx)
	vmovups	%ymm8, 3686400(%rax,%rcx)
	vmovups	%ymm8, 3686432(%rax,%rcx)
	vmovups	%ymm8, 7372800(%rax,%rcx)
	vmovups	%ymm8, 7372832(%rax,%rcx)
	vmovups	%ymm8, 11059200(%rax,%rcx)
	movq	%rcx, -96(%rsp)
	vmovups	%ymm8, 11059232(%rax,%rcx)
	cmpl	%r11d, %r14d
	jge	.LBB1_9
	andb	%r9b, %bl
	movzbl	%bl, %eax
	subl	%eax, %ebp
	imull	$268435376, %ebp, %eax
	addl	%r8d, %eax
	shll	$4, %eax
	vcvtsi2ss	%eax, %xmm0, %xmm16
	shll	$4, %ebp
	vcvtsi2ss	%ebp, %xmm0, %xmm24
	leal	32(%r14), %r15d
	imull	$57584, %edx, %eax
	movl	-124(%rsp), %ecx
	movl	%ecx, %edx
	subl	%eax, %edx
	movl	%r11d, -116(%rsp)
	jmp	.LBB1_4
	.p2align	4, 0x90
.LBB1_11:
	movl	%r15d, %r14d
	leal	32(%r15), %eax
	movl	%eax, %r15d
.LBB1_12:
	cmpl	%r11d, %r14d
	jge	.LBB1_9
.LBB1_4:
	movq	24(%r10), %rcx
	movslq	%r14d, %rsi
	movq	40(%r10), %rax
	movl	36(%r10), %ebx
	imull	(%rcx,%rsi,4), %ebx
	movslq	%ebx, %rcx
	vmovss	(%rax,%rcx,4), %xmm3
	vsubss	%xmm16, %xmm3, %xmm17
	leal	1(%rcx), %esi
	movslq	%esi, %rsi
	vmovss	(%rax,%rsi,4), %xmm4
	vsubss	%xmm24, %xmm4, %xmm4
	leal	6(%rcx), %esi
	movslq	%esi, %rsi
	vmovss	(%rax,%rsi,4), %xmm6
	leal	7(%rcx), %esi
	movslq	%esi, %rsi
	addl	$8, %ecx
	movslq	%ecx, %rcx
	vmovss	(%rax,%rcx,4), %xmm5
	vsubss	%xmm6, %xmm4, %xmm20
	vaddss	%xmm6, %xmm4, %xmm19
	vmovss	.LCPI1_1(%rip), %xmm0
	vdivss	%xmm5, %xmm0, %xmm0
	vmovss	.LCPI1_2(%rip), %xmm9
	vaddss	%xmm9, %xmm17, %xmm1
	vbroadcastss	(%rax,%rsi,4), %ymm18
	vmulss	%xmm18, %xmm1, %xmm1
	vmulss	%xmm0, %xmm1, %xmm1
	vaddss	%xmm1, %xmm4, %xmm1
	vaddss	.LCPI1_3(%rip), %xmm17, %xmm7
	vmulss	%xmm18, %xmm7, %xmm7
	vmulss	%xmm0, %xmm7, %xmm7
	vaddss	%xmm7, %xmm4, %xmm7
	vandps	48(%rsp), %xmm0, %xmm0
	vminss	%xmm1, %xmm7, %xmm6
	vucomiss	%xmm1, %xmm1
	setp	%cl
	kmovd	%ecx, %k1
	vmovss	%xmm7, %xmm6, %xmm6 {%k1}
	vsubss	%xmm0, %xmm6, %xmm6
	vmaxss	%xmm20, %xmm6, %xmm3
	vcmpunordss	%xmm20, %xmm20, %k2
	vmovss	%xmm6, %xmm3, %xmm3 {%k2}
	vmaxss	%xmm1, %xmm7, %xmm1
	vmovss	%xmm7, %xmm1, %xmm1 {%k1}
	vaddss	%xmm1, %xmm0, %xmm0
	vminss	%xmm19, %xmm0, %xmm1
	vcmpunordss	%xmm19, %xmm19, %k1
	vmaxss	.LCPI1_5(%rip), %xmm3, %xmm3
	vaddss	%xmm3, %xmm9, %xmm3
	vroundss	$10, %xmm3, %xmm3, %xmm3
	vcvttss2si	%xmm3, %ecx
	vmovss	%xmm0, %xmm1, %xmm1 {%k1}
	movl	%ecx, %esi
	sarl	$31, %esi
	vminss	.LCPI1_6(%rip), %xmm1, %xmm0
	vaddss	%xmm0, %xmm9, %xmm0
	vroundss	$9, %xmm0, %xmm0, %xmm0
	andnl	%ecx, %esi, %esi
	vcvttss2si	%xmm0, %ecx
	cmpl	$15, %ecx
	cmovgel	%r12d, %ecx
	cmpl	%ecx, %esi
	jg	.LBB1_7
	leal	9(%rbx), %ebp
	movslq	%ebp, %r8
	leal	10(%rbx), %ebp
	movslq	%ebp, %rbp
	vmovss	(%rax,%rbp,4), %xmm6
	vbroadcastss	%xmm17, %ymm0
	vmovaps	.LCPI1_7(%rip), %ymm1
	vsubps	%ymm0, %ymm1, %ymm1
	vmovaps	.LCPI1_8(%rip), %ymm3
	vsubps	%ymm0, %ymm3, %ymm0
	vmulps	%ymm18, %ymm1, %ymm17
	vmulps	%ymm18, %ymm0, %ymm18
	vbroadcastss	(%rax,%r8,4), %ymm3
	vmulps	%ymm3, %ymm1, %ymm19
	vmulps	%ymm3, %ymm0, %ymm20
	leal	15(%rbx), %ebp
	movslq	%ebp, %rbp
	movq	%rbp, 40(%rsp)
	leal	14(%rbx), %ebp
	movslq	%ebp, %rbp
	movq	%rbp, 32(%rsp)
	leal	12(%rbx), %ebp
	movslq	%ebp, %r13
	leal	11(%rbx), %ebp
	movslq	%ebp, %r10
	leal	5(%rbx), %ebp
	movslq	%ebp, %r11
	leal	4(%rbx), %ebp
	movq	%rdi, %r9
	movq	%r15, %rdi
	movq	%r14, %r15
	movslq	%ebp, %r14
	leal	3(%rbx), %ebp
	movslq	%ebp, %rbp
	addl	$2, %ebx
	movslq	%ebx, %r12
	movl	%esi, %ebx
	movslq	%ecx, %r8
	movq	40(%rsp), %rcx
	vbroadcastss	(%rax,%rcx,4), %ymm21
	vbroadcastss	(%rax,%r13,4), %ymm22
	movq	32(%rsp), %rcx
	vbroadcastss	(%rax,%rcx,4), %ymm23
	vbroadcastss	(%rax,%r12,4), %ymm25
	vbroadcastss	(%rax,%rbp,4), %ymm26
	vbroadcastss	(%rax,%r10,4), %ymm27
	movq	-104(%rsp), %r10
	movl	$15, %r12d
	vbroadcastss	(%rax,%r14,4), %ymm28
	movq	%r15, %r14
	movq	%rdi, %r15
	movq	%r9, %rdi
	vbroadcastss	(%rax,%r11,4), %ymm29
	movl	-116(%rsp), %r11d
	.p2align	4, 0x90
.LBB1_6:
	vcvtsi2ss	%ebx, %xmm2, %xmm0
	vaddss	%xmm31, %xmm0, %xmm0
	vsubss	%xmm4, %xmm0, %xmm0
	vmulss	%xmm0, %xmm5, %xmm1
	vmulss	%xmm0, %xmm6, %xmm0
	vbroadcastss	%xmm0, %ymm0
	vaddps	%ymm0, %ymm19, %ymm3
	vaddps	%ymm0, %ymm20, %ymm0
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	leal	(%rdx,%rbx), %ecx
	movslq	%ecx, %r9
	shlq	$6, %r9
	vmulps	%ymm3, %ymm3, %ymm3
	vmulps	%ymm3, %ymm23, %ymm7
	vsubps	%ymm3, %ymm2, %ymm3
	vmaxps	%ymm8, %ymm3, %ymm3
	vmulps	%ymm3, %ymm21, %ymm3
	vminps	%ymm2, %ymm3, %ymm3
	vmovups	(%rax,%r9), %ymm30
	vmovups	32(%rax,%r9), %ymm9
	vmulps	%ymm30, %ymm25, %ymm12
	vmulps	%ymm0, %ymm0, %ymm0
	vmulps	%ymm0, %ymm23, %ymm13
	vsubps	%ymm0, %ymm2, %ymm0
	vmaxps	%ymm8, %ymm0, %ymm0
	vmulps	%ymm0, %ymm21, %ymm0
	vminps	%ymm2, %ymm0, %ymm0
	vbroadcastss	%xmm1, %ymm1
	vaddps	%ymm1, %ymm17, %ymm14
	vmulps	%ymm14, %ymm14, %ymm15
	vsubps	%ymm15, %ymm2, %ymm15
	vsubps	%ymm7, %ymm15, %ymm7
	vmaxps	%ymm8, %ymm7, %ymm7
	vmulps	%ymm7, %ymm22, %ymm7
	vcmpltps	%ymm2, %ymm7, %k1
	vmulps	%ymm7, %ymm3, %ymm3 {%k1}
	vmulps	%ymm3, %ymm3, %ymm3
	vmulps	%ymm3, %ymm12, %ymm3
	vsubps	%ymm3, %ymm30, %ymm7
	vmovups	%ymm7, (%rax,%r9)
	vmulps	%ymm14, %ymm11, %ymm7
	vsubps	%ymm7, %ymm27, %ymm7
	vmulps	%ymm7, %ymm14, %ymm7
	vaddps	%ymm7, %ymm10, %ymm7
	vmulps	%ymm3, %ymm7, %ymm3
	vmulps	%ymm3, %ymm26, %ymm7
	vaddps	3686400(%rax,%r9), %ymm7, %ymm7
	vmovups	%ymm7, 3686400(%rax,%r9)
	vmulps	%ymm9, %ymm25, %ymm7
	vaddps	%ymm1, %ymm18, %ymm1
	vmulps	%ymm1, %ymm1, %ymm12
	vsubps	%ymm12, %ymm2, %ymm12
	vsubps	%ymm13, %ymm12, %ymm12
	vmaxps	%ymm8, %ymm12, %ymm12
	vmulps	%ymm12, %ymm22, %ymm12
	vcmpltps	%ymm2, %ymm12, %k1
	vmulps	%ymm12, %ymm0, %ymm0 {%k1}
	vmulps	%ymm0, %ymm0, %ymm0
	vmulps	%ymm7, %ymm0, %ymm0
	vsubps	%ymm0, %ymm9, %ymm7
	vmovups	%ymm7, 32(%rax,%r9)
	vmulps	%ymm1, %ymm11, %ymm7
	vsubps	%ymm7, %ymm27, %ymm7
	vmulps	%ymm7, %ymm1, %ymm1
	vaddps	%ymm1, %ymm10, %ymm1
	vmulps	%ymm0, %ymm1, %ymm0
	vmulps	%ymm0, %ymm26, %ymm1
	vaddps	3686432(%rax,%r9), %ymm1, %ymm1
	vmovups	%ymm1, 3686432(%rax,%r9)
	vmulps	%ymm3, %ymm28, %ymm1
	vaddps	7372800(%rax,%r9), %ymm1, %ymm1
	vmovups	%ymm1, 7372800(%rax,%r9)
	vmulps	%ymm0, %ymm28, %ymm1
	vaddps	7372832(%rax,%r9), %ymm1, %ymm1
	vmovups	%ymm1, 7372832(%rax,%r9)
	vmulps	%ymm3, %ymm29, %ymm1
	vaddps	11059200(%rax,%r9), %ymm1, %ymm1
	vmovups	%ymm1, 11059200(%rax,%r9)
	vmulps	%ymm0, %ymm29, %ymm0
	vaddps	11059232(%rax,%r9), %ymm0, %ymm0
	vmovups	%ymm0, 11059232(%rax,%r9)
	leaq	1(%rbx), %rax
	cmpq	%r8, %rbx
	movq	%rax, %rbx
	jl	.LBB1_6
.LBB1_7:
	incl	%r14d
	cmpl	%r15d, %r14d
	jne	.LBB1_12
	movq	8(%rdi), %rax
	movq	88(%rax), %rax
	movq	24(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm4
	movq	16(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm5
	movq	8(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm17
	movq	(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm18
	movq	-8(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm19
	movq	-16(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm20
	movq	-24(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm21
	movq	-32(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm22
	movq	-40(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm23
	movq	-48(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm6
	movq	-56(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm25
	movq	-64(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm26
	movq	-72(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm27
	movq	-80(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm28
	movq	-88(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm29
	movq	-96(%rsp), %rcx
	vmovups	(%rax,%rcx), %zmm30
	movq	(%rdi), %rax
	vmovss	52(%rax), %xmm0
	vcmpunordps	%zmm4, %zmm4, %k1
	vmaxps	%zmm4, %zmm5, %zmm1
	vmovaps	%zmm5, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm17, %zmm1
	vmovaps	%zmm17, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm18, %zmm1
	vmovaps	%zmm18, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm19, %zmm1
	vmovaps	%zmm19, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm20, %zmm1
	vmovaps	%zmm20, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm21, %zmm1
	vmovaps	%zmm21, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm22, %zmm1
	vmovaps	%zmm22, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm23, %zmm1
	vmovaps	%zmm23, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm6, %zmm1
	vmovaps	%zmm6, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm25, %zmm1
	vmovaps	%zmm25, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm26, %zmm1
	vmovaps	%zmm26, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm27, %zmm1
	vmovaps	%zmm27, %zmm1 {%k1}
	vcmpunordps	%zmm1, %zmm1, %k1
	vmaxps	%zmm1, %zmm28, %zmm1
	vmovaps	%zmm28, %zmm1 {%k1}
	vmaxps	%zmm1, %zmm29, %zmm3
	vcmpunordps	%zmm1, %zmm1, %k1
	vmovaps	%zmm29, %zmm3 {%k1}
	vmaxps	%zmm3, %zmm30, %zmm1
	vcmpunordps	%zmm3, %zmm3, %k1
	vmovaps	%zmm30, %zmm1 {%k1}
	vmovshdup	%xmm1, %xmm3
	vmaxss	%xmm1, %xmm3, %xmm4
	vcmpunordss	%xmm1, %xmm1, %k1
	vmovss	%xmm3, %xmm4, %xmm4 {%k1}
	vpermilpd	$1, %xmm1, %xmm3
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm3, %xmm4
	vmovss	%xmm3, %xmm4, %xmm4 {%k1}
	vpermilps	$255, %xmm1, %xmm3
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm3, %xmm4
	vmovss	%xmm3, %xmm4, %xmm4 {%k1}
	vextractf128	$1, %ymm1, %xmm3
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm3, %xmm4
	vmovss	%xmm3, %xmm4, %xmm4 {%k1}
	vmovshdup	%xmm3, %xmm5
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm5, %xmm4
	vmovss	%xmm5, %xmm4, %xmm4 {%k1}
	vpermilpd	$1, %xmm3, %xmm5
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm5, %xmm4
	vmovss	%xmm5, %xmm4, %xmm4 {%k1}
	vpermilps	$255, %xmm3, %xmm3
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm3, %xmm4
	vmovss	%xmm3, %xmm4, %xmm4 {%k1}
	vextractf32x4	$2, %zmm1, %xmm3
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm3, %xmm4
	vmovss	%xmm3, %xmm4, %xmm4 {%k1}
	vmovshdup	%xmm3, %xmm5
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm5, %xmm4
	vmovss	%xmm5, %xmm4, %xmm4 {%k1}
	vpermilpd	$1, %xmm3, %xmm5
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm5, %xmm4
	vmovss	%xmm5, %xmm4, %xmm4 {%k1}
	vpermilps	$255, %xmm3, %xmm3
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm3, %xmm4
	vmovss	%xmm3, %xmm4, %xmm4 {%k1}
	vextractf32x4	$3, %zmm1, %xmm1
	vcmpunordss	%xmm4, %xmm4, %k1
	vmaxss	%xmm4, %xmm1, %xmm3
	vmovss	%xmm1, %xmm3, %xmm3 {%k1}
	vmovshdup	%xmm1, %xmm4
	vcmpunordss	%xmm3, %xmm3, %k1
	vmaxss	%xmm3, %xmm4, %xmm3
	vmovss	%xmm4, %xmm3, %xmm3 {%k1}
	vpermilpd	$1, %xmm1, %xmm4
	vcmpunordss	%xmm3, %xmm3, %k1
	vmaxss	%xmm3, %xmm4, %xmm3
	vmovss	%xmm4, %xmm3, %xmm3 {%k1}
	vpermilps	$255, %xmm1, %xmm1
	vcmpunordss	%xmm3, %xmm3, %k1
	vmaxss	%xmm3, %xmm1, %xmm3
	vmovss	%xmm1, %xmm3, %xmm3 {%k1}
	vucomiss	%xmm3, %xmm0
	jbe	.LBB1_11
	jmp	.LBB1_9
.LBB1_10:
	addq	$72, %rsp
	popq	%rbx
	popq	%r12
	popq	%r13
	popq	%r14
	popq	%r15
	popq	%rbp
	vzeroupper
	retq
.Lfunc_end1:
	.size	function_body, .Lfunc_end1-function_body

	.p2align	4, 0x90
	.type	cpu_parallel_range_for_task,@function
cpu_parallel_range_for_task:
	.cfi_startproc
	pushq	%rbp
	.cfi_def_cfa_offset 16
	.cfi_offset %rbp, -16
	movq	%rsp, %rbp
	.cfi_def_cfa_register %rbp
	pushq	%r15
	pushq	%r14
	pushq	%r13
	pushq	%r12
	pushq	%rbx
	subq	$72, %rsp
	.cfi_offset %rbx, -56
	.cfi_offset %r12, -48
	.cfi_offset %r13, -40
	.cfi_offset %r14, -32
	.cfi_offset %r15, -24
	movl	%edx, %r12d
	movl	%esi, %eax
	movq	(%rdi), %rdx
	movq	8(%rdi), %r8
	movq	16(%rdi), %r14
	movq	24(%rdi), %rcx
	movq	%rcx, -72(%rbp)
	movq	32(%rdi), %rcx
	movl	40(%rdi), %esi
	movl	44(%rdi), %ebx
	movl	48(%rdi), %r13d
	movl	52(%rdi), %edi
	movq	%rsp, %r15
	addq	$15, %rcx
	andq	$-16, %rcx
	subq	%rcx, %r15
	movq	%r15, %rsp
	testq	%r8, %r8
	movq	%rdx, -64(%rbp)
	je	.LBB2_2
	movl	%edi, -44(%rbp)
	movq	%rdx, %rdi
	movl	%esi, -52(%rbp)
	movq	%r15, %rsi
	movl	%eax, -48(%rbp)
	callq	*%r8
	movl	-44(%rbp), %edi
	movl	-48(%rbp), %eax
	movl	-52(%rbp), %esi
	movq	-64(%rbp), %rdx
.LBB2_2:
	movups	(%rdx), %xmm0
	movups	16(%rdx), %xmm1
	movaps	%xmm1, -96(%rbp)
	movaps	%xmm0, -112(%rbp)
	movl	%eax, -96(%rbp)
	cmpl	$-1, %edi
	je	.LBB2_7
	cmpl	$1, %edi
	jne	.LBB2_10
	imull	%r13d, %r12d
	addl	%esi, %r12d
	addl	%r12d, %r13d
	cmpl	%r13d, %ebx
	cmovll	%ebx, %r13d
	cmpl	%r13d, %r12d
	jge	.LBB2_10
	leaq	-112(%rbp), %rbx
	.p2align	4, 0x90
.LBB2_6:
	movq	%rbx, %rdi
	movq	%r15, %rsi
	movl	%r12d, %edx
	callq	*%r14
	incl	%r12d
	cmpl	%r13d, %r12d
	jl	.LBB2_6
	jmp	.LBB2_10
.LBB2_7:
	imull	%r13d, %r12d
	subl	%r12d, %ebx
	imull	%ebx, %r13d
	cmpl	%r13d, %esi
	cmovgl	%esi, %r13d
	cmpl	%r13d, %ebx
	jle	.LBB2_10
	leaq	-112(%rbp), %r12
	.p2align	4, 0x90
.LBB2_9:
	decl	%ebx
	movq	%r12, %rdi
	movq	%r15, %rsi
	movl	%ebx, %edx
	callq	*%r14
	cmpl	%r13d, %ebx
	jg	.LBB2_9
.LBB2_10:
	movq	-72(%rbp), %rax
	testq	%rax, %rax
	je	.LBB2_12
	movq	-64(%rbp), %rdi
	movq	%r15, %rsi
	callq	*%rax
.LBB2_12:
	leaq	-40(%rbp), %rsp
	popq	%rbx
	popq	%r12
	popq	%r13
	popq	%r14
	popq	%r15
	popq	%rbp
	.cfi_def_cfa %rsp, 8
	retq
.Lfunc_end2:
	.size	cpu_parallel_range_for_task, .Lfunc_end2-cpu_parallel_range_for_task
	.cfi_endproc

	.ident	"Ubuntu clang version 14.0.6"
	.section	".note.GNU-stack","",@progbits
